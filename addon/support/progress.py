"""What to tell of a part of some work."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[float], object]


def part_of(progress: Progress | None, start: float, share: float) -> Progress | None:
    """For a part that begins at `start` and is `share` of the whole; None if nothing is to be told."""
    return None if progress is None else lambda done: progress(start + share * done)
