"""A clean terminal: Blender's chatter is kept off standard output, any text can be written, and tables line up."""

from __future__ import annotations

import ctypes
import errno
import io
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from typing import Any, TextIO


def _flush_c_streams() -> None:
    """Push out what C code has printed but not yet written; without it the text would surface later."""
    sys.stdout.flush()
    # On Windows Blender and Python print through the Universal C Runtime; msvcrt.dll is another, with other streams.
    ctypes.CDLL("ucrtbase" if os.name == "nt" else None).fflush(None)


def write_any_text() -> None:
    """From now on what the output's encoding lacks is written as an escape, as Python does for errors.

    Names in a file are of any language; a redirected output on Windows has one code page, as other systems may.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def is_reader_gone(error: OSError) -> bool:
    """Whether it comes of writing to a pipe that nobody reads any more, as `| head` leaves it."""
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
        """Those that were not told before."""
        for warning in warnings:
            if warning not in self._told:
                self._told.add(warning)
                self.say(warning)

    def say(self, sentence: str) -> None:
        """Beside a progress bar."""
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
