"""What frames did to the trees and how long they took, as text."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING

from ..statistics.words import count_of, duration, memory, primitives

if TYPE_CHECKING:
    from collections.abc import Sequence

    from perfect_bvh import CommitReport

    from ..statistics.frame_statistics import FrameStatistics
    from ..sync.report import SyncReport

REFITS = ("refitted", "rotated", "partly_rebuilt")  # what goes on with the tree that was there

# Title and width of each column of --stats.
TREE_COLUMNS = (("frame", 6), ("built", 6), ("refit", 6), ("rebuilt", 8), ("moved", 8), ("added", 8), ("gone", 6))
TIME_COLUMNS = (
    ("blender", 8),
    ("read", 7),
    ("compare", 8),
    ("update", 7),
    ("build", 7),
    ("trace", 8),
    ("denoise", 8),
    ("save", 6),
    ("total", 8),
)
SAMPLES_COLUMN = ("samples", 8)
RATE_COLUMN = ("Mrays/s", 8)
MAX_NAMES = 4
# What a run's summary tells of the steps of a frame.
SUMMED = ("blender", "read", "build", "trace", "denoise", "save")


@dataclass(frozen=True, slots=True)
class FrameTimes:
    """Where one frame's milliseconds went.

    blender: Blender's own evaluation of the scene, and its render pipeline. read: the depsgraph into arrays.
    compare: with the frame before. update: edits of the engine's scene. build: trees built and refitted.
    An audit counts in `total` alone.
    """

    blender: float
    read: float
    compare: float
    update: float
    build: float
    trace: float
    denoise: float
    save: float
    total: float

    @classmethod
    def of(cls, statistics: FrameStatistics, *, total: float, save: float) -> FrameTimes:
        """From a frame's statistics and what the caller measured, in seconds, around it."""
        report = statistics.report
        known = report.milliseconds + statistics.trace_milliseconds + statistics.denoise_milliseconds
        known += statistics.audit_milliseconds + save * 1e3
        return cls(
            blender=max(0.0, total * 1e3 - known),
            read=report.read_milliseconds,
            compare=report.compare_milliseconds,
            update=report.apply_milliseconds,
            build=report.commit_milliseconds,
            trace=statistics.trace_milliseconds,
            denoise=statistics.denoise_milliseconds,
            save=save * 1e3,
            total=total * 1e3,
        )


def format_header() -> str:
    """Titles of the columns of `format_frame`; all times are milliseconds, samples those of a pixel on average."""
    return "".join(title.rjust(width) for title, width in (*TREE_COLUMNS, *TIME_COLUMNS, SAMPLES_COLUMN, RATE_COLUMN))


def format_frame(number: int, statistics: FrameStatistics, times: FrameTimes) -> str:
    """One frame: a line of numbers, and a line for each kind of thing that changed."""
    report = statistics.report
    commit = report.commit
    counts = (
        number,
        commit.count("built"),
        commit.count(*REFITS),
        commit.count("rebuilt"),
        report.moved_count,
        report.added_count,
        report.removed_count,
    )
    cells = [f"{count:,}".rjust(width) for count, (_, width) in zip(counts, TREE_COLUMNS, strict=True)]
    cells += [f"{getattr(times, title):.1f}".rjust(width) for title, width in TIME_COLUMNS]
    cells.append(f"{statistics.samples:.4g}".rjust(SAMPLES_COLUMN[1]))
    cells.append(f"{statistics.rays_per_second / 1e6:.2f}".rjust(RATE_COLUMN[1]))
    return "\n".join(["".join(cells), *(f"        {line}" for line in (*describe_changes(report), *stages_of(commit)))])


def describe_changes(report: SyncReport) -> list[str]:
    """What happened to trees and instances, and why, a sentence each; empty if nothing did."""
    names = {mesh.mesh_id: mesh.name for mesh in report.meshes}
    groups: dict[tuple[str, str], list[str]] = {}
    for mesh in report.commit.meshes:
        name = f"{names.get(mesh.mesh_id, mesh.mesh_id)} ({primitives(mesh.triangle_count, mesh.kind)})"
        groups.setdefault((f"{mesh.action.replace('_', ' ')} tree", mesh.reason), []).append(name)
    for change in report.objects:
        if change.action in {"moved", "masked", "recounted", "removed"}:
            count = f" x {change.changed_count:,}" if change.changed_count > 1 else ""
            groups.setdefault((change.action, change.reason), []).append(f"{change.name}{count}")
    return [f"{action}: {_shorten(members)}: {reason}" for (action, reason), members in groups.items()]


def stages_of(commit: CommitReport) -> list[str]:
    """Where the time in trees went: a line for those of meshes, one for the top level; none for what took no time."""
    levels = (("trees of meshes", commit.mesh_stages), ("top level", commit.top_level.stages))
    lines = []
    for level, stages in levels:
        parts = [f"{name} {duration(milliseconds)}" for name, milliseconds in stages.items() if milliseconds >= 0.05]
        if parts:
            lines.append(f"{level}: {', '.join(parts)}")
    return lines


def _shorten(names: Sequence[str]) -> str:
    rest = len(names) - MAX_NAMES
    return ", ".join(names[:MAX_NAMES]) + (f" and {rest:,} more" if rest > 0 else "")


def format_summary(reports: Sequence[SyncReport], times: Sequence[FrameTimes], where: str) -> str:
    """What a run did in all. reports, times: one for each frame that was written, at least one."""
    total = sum(time.total for time in times)
    count = len(times)
    totals = {
        name: sum(report.commit.count(*actions) for report in reports)
        for name, actions in (("built", ("built",)), ("refitted", REFITS), ("rebuilt", ("rebuilt",)))
    }
    moved = sum(report.moved_count for report in reports)
    lines = [
        f"{where}: {count_of(count, 'frame')} in {duration(total)}",
        f"trees: {totals['built']:,} built, {totals['refitted']:,} refits, {totals['rebuilt']:,} rebuilt; "
        f"instances moved: {moved:,}; {memory(reports[-1].byte_count)}",
    ]
    parts = [f"{name} {duration(median(getattr(time, name) for time in times))}" for name in SUMMED]
    what = "median frame" if count > 1 else "frame"
    lines.append(f"{what} {duration(median(time.total for time in times))}: {', '.join(parts)}")
    return "\n".join(lines)
