"""What a frame cost and what was done for it, as short rows of text for a panel. Knows no panel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .words import duration, memory, rate

if TYPE_CHECKING:
    from ..sync.report import SyncReport
    from .frame_statistics import FrameStatistics


def statistics_rows(statistics: FrameStatistics) -> list[tuple[str, str]]:
    """(name, value) of the steps of a frame in their order, then of what they were done to."""
    report = statistics.report
    width, height = statistics.size
    rows = [
        (statistics.source, f"Frame {statistics.frame:g}"),
        ("Resolution", f"{width} x {height} px"),
        ("Sync", duration(report.read_milliseconds + report.compare_milliseconds + report.apply_milliseconds)),
        ("Build", duration(report.commit_milliseconds)),
        ("Trace", duration(statistics.trace_milliseconds)),
        *([("Denoise", duration(statistics.denoise_milliseconds))] if statistics.denoiser else []),
        ("Samples", f"{statistics.samples:.4g} a pixel"),
        ("Camera Rays", rate(statistics.rays_per_second)),
        ("Instances", f"{report.commit.instance_count:,}"),
        ("Memory", memory(report.byte_count)),
    ]
    for action in ("built", "rebuilt", "refitted", "rotated", "partly_rebuilt"):
        count = sum(mesh.action == action for mesh in report.commit.meshes)
        if count:
            rows.append((action.replace("_", " ").title(), f"{count:,} of {count_meshes(report):,} trees"))
    return rows


def count_meshes(report: SyncReport) -> int:
    """How many distinct meshes the scene has."""
    return len(report.meshes) - report.count_meshes("removed")
