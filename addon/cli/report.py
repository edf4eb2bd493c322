"""What frames did to the trees and how long they took, as text."""

from __future__ import annotations

import ctypes
import errno
import io
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING, Any, TextIO

from ..statistics.words import count_of, duration, memory, primitives

if TYPE_CHECKING:
    from perfect_bvh import CommitReport

    from ..statistics.last_result import FrameStatistics
    from ..sync.report import SyncReport

# A clean terminal: Blender's chatter is kept off standard output, any text can be written, and tables line up.


def _flush_c_streams() -> None:
    """Push out what C code has printed but not yet written; without it the text would surface later."""
    sys.stdout.flush()
    # On Windows Blender and Python print through the Universal C Runtime; msvcrt.dll is another, with other streams.
    ctypes.CDLL("ucrtbase" if os.name == "nt" else None).fflush(None)


def write_any_text() -> None:
    """Writes characters that the output's encoding lacks as escapes from now on, as Python does for errors.

    Names in a file are of any language; a redirected output on Windows has one code page, as other systems may.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def is_reader_gone(error: OSError) -> bool:
    """Whether the error comes from writing to a pipe without a reader, as after `| head`."""
    if isinstance(error, BrokenPipeError):
        return True
    # Windows' C library knows but one of the two codes that a closed pipe has, and takes the other for a bad argument.
    return os.name == "nt" and error.errno == errno.EINVAL and error.strerror == os.strerror(errno.EINVAL)


def _writes_to_descriptor_1() -> bool:
    try:
        return sys.stdout.fileno() == 1
    except (OSError, ValueError, AttributeError):  # captured, closed, or no stdout at all
        return False


@contextmanager
def quiet_blender() -> Iterator[TextIO]:
    """Silence standard output, C code's and Python's alike; yields a stream for this program's own words."""
    _flush_c_streams()
    saved = os.dup(1)
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    python_stdout = sys.stdout
    own = python_stdout
    if _writes_to_descriptor_1():
        own = os.fdopen(os.dup(saved), "w", encoding=python_stdout.encoding, errors="backslashreplace")
    try:
        # Blender prints the errors of operators through Python's stream.
        with os.fdopen(silence, "w", encoding="utf-8") as silent_stream, redirect_stdout(silent_stream):
            yield own
    finally:
        _flush_c_streams()
        os.dup2(saved, 1)
        os.close(saved)
        if own is not python_stdout:
            own.close()


def progress_bar(unit: str, total: int, is_quiet: bool) -> Any:
    """A progress bar; on a terminal only, so that logs stay clean."""
    from tqdm import tqdm

    bar_format = "{l_bar}{bar}| {n:.3g}/{total} [{elapsed}<{remaining}]"
    is_disabled = True if is_quiet else None
    return tqdm(total=total, unit=unit, bar_format=bar_format, disable=is_disabled, leave=False, file=sys.stderr)


class Teller:
    """Writes warnings, each once."""

    def __init__(self, told: set[str] | None = None) -> None:
        self._told = told if told is not None else set()

    def tell(self, warnings: Iterable[str]) -> None:
        """Reports warnings that were not reported before."""
        for warning in warnings:
            if warning not in self._told:
                self._told.add(warning)
                self.say(warning)

    def say(self, sentence: str) -> None:
        """Writes a sentence without breaking the progress bar."""
        from tqdm import tqdm

        tqdm.write(f"perfect-bvh: {sentence}", file=sys.stderr)


def format_table(header: Sequence[str], rows: Sequence[Sequence[str]], left: frozenset[int] = frozenset({0})) -> str:
    """Columns two spaces apart; those in `left` are aligned left, the others right."""
    lines = [header, *rows]
    widths = [max(len(line[column]) for line in lines) for column in range(len(header))]

    def format_line(line: Sequence[str]) -> str:
        cells = (
            cell.ljust(width) if column in left else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(line, widths, strict=True))
        )
        return "  ".join(cells).rstrip()

    return "\n".join([format_line(header), "  ".join("-" * width for width in widths), *map(format_line, rows)])


# Report --------------------------------------------------------------------------------------------------------------


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
# The steps of a frame in a run's summary.
SUMMED = ("blender", "read", "build", "trace", "denoise", "save")


@dataclass(frozen=True, slots=True)
class FrameTimes:
    """The milliseconds of one frame, by step.

    blender: Blender's own evaluation of the scene, and its render pipeline. read: the depsgraph into arrays.
    compare: with the previous frame. update: edits of the engine's scene. build: trees built and refitted.
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
        """Combines a frame's statistics and the caller's measurements, in seconds, around it."""
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
    """One frame: a line of numbers, and a line for each kind of change."""
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
    """Describes the changes of trees and instances, and the reasons, a sentence each; empty without changes."""
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
    """Describes the time in trees: a line for those of meshes, one for the top level; none for stages without time."""
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
    """Summarises a run. reports, times: one for each frame that was written, at least one."""
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
