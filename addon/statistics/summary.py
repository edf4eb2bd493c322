"""What a frame cost and what was done for it, as short rows of text for a panel. Knows no panel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from .words import duration, memory, rate

if TYPE_CHECKING:
    from collections.abc import Mapping

    from perfect_bvh import MeshReport

    from ..sync.records import UnseenMesh
    from ..sync.report import MeshChange, SyncReport
    from .frame_statistics import FrameStatistics

SHOWN_MESHES = 10


@dataclass(frozen=True, slots=True)
class PlanRow:
    """One mesh.

    usage: its class, and usage_reason why. action: what the last frame did to its tree. reason: a sentence.
    ray_share: of the camera rays' work, 0 to 1, what went into rays that end on it. milliseconds, byte_count: of the
    tree that was made or weighed, else 0. source, session_uid: what the mesh comes
    from, as the Select Objects button takes it.
    """

    name: str
    source: str
    session_uid: int
    triangle_count: int
    usage: str
    usage_reason: str
    action: str
    builder: str
    reason: str
    milliseconds: float
    byte_count: int
    ray_share: float


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


def plan_rows(
    report: SyncReport, mesh_costs: Mapping[int, float] | None = None, limit: int = SHOWN_MESHES
) -> list[PlanRow]:
    """The meshes that cost camera rays most (see `FrameStatistics`), then those that took longest, then the largest."""
    commits = {mesh.mesh_id: mesh for mesh in (*report.commit.meshes, *report.commit.resting)}
    costs = mesh_costs or {}
    rows = [
        _row_of(change, commits.get(change.mesh_id), costs.get(change.mesh_id, 0.0))
        for change in report.meshes
        if change.action != "removed"
    ]
    rows += [_row_of_unseen(mesh) for mesh in report.unseen]
    rows.sort(key=lambda row: (-row.ray_share, -row.milliseconds, -row.triangle_count, row.name))
    return rows[:limit]


def _row_of(change: MeshChange, commit: MeshReport | None, ray_share: float) -> PlanRow:
    """commit: what the engine did for it, None for a mesh that it did not look at."""
    source, session_uid = change.key[:2]
    return PlanRow(
        name=change.name,
        source=source,
        session_uid=session_uid,
        triangle_count=change.triangle_count,
        usage=change.usage,
        usage_reason=change.usage_reason,
        action=commit.action.replace("_", " ") if commit else "kept",
        builder=commit.builder if commit else "",
        reason=commit.reason if commit else change.reason,
        milliseconds=commit.milliseconds if commit else 0.0,
        byte_count=commit.byte_count if commit else 0,
        ray_share=ray_share,
    )


def _row_of_unseen(mesh: UnseenMesh) -> PlanRow:
    return PlanRow(
        name=mesh.name,
        source=mesh.source,
        session_uid=mesh.session_uid,
        triangle_count=0,
        usage="unseen",
        usage_reason=mesh.reason,
        action="left out",
        builder="",
        reason="no ray can meet it, so nothing is read or built",
        milliseconds=0.0,
        byte_count=0,
        ray_share=0.0,
    )


def count_meshes(report: SyncReport) -> int:
    """How many distinct meshes the scene has."""
    return len(report.meshes) - report.count_meshes("removed")
