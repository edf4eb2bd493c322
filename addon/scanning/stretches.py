"""A scan is cut into stretches, from one key moment of the scene to the next. Knows no Blender."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from .patterns import Pattern, check_at_least


@dataclass(frozen=True, slots=True)
class Stretch:
    """A part of the scan. frame: None for the current one. start, end: seconds since it began. next_...: its end."""

    frame: int | None
    subframe: float
    start: float
    end: float
    next_frame: int = 0
    next_subframe: float = 0.0


def rays_before(pattern: Pattern, stretches: tuple[Stretch, ...]) -> int:
    """How many a scan has cast before these, which may be a later part of it."""
    begin, end = stretches[0].start, stretches[0].end
    if pattern.needs_camera and end > begin:  # a picture a stretch
        return round(begin / (end - begin)) * pattern.count(begin, end)
    return pattern.count(0.0, begin) if begin > 0.0 else 0


def stretches_of(
    pattern: Pattern,
    rate: float,
    frames: tuple[int, int] | None,
    steps_per_frame: int,
    since: int | None,
) -> Iterator[Stretch]:
    """rate: frames a second. The rest: as `scan` takes it, which the errors name."""
    if frames is None:
        yield Stretch(None, 0.0, 0.0, pattern.duration)
        return
    first, last = frames
    if last < first:
        raise ValueError(f"scan: frames must be (first, last) with first <= last, got {frames}")
    check_at_least("scan", "steps_per_frame", steps_per_frame, 1)
    before = 0 if since is None else (first - since) * steps_per_frame
    if before < 0:
        raise ValueError(f"scan: since must be no later than the first of the frames {frames}, got {since}")
    seconds = 1.0 / rate / steps_per_frame
    for number in range((last - first + 1) * steps_per_frame):
        frame, step = divmod(number, steps_per_frame)
        following, next_step = divmod(number + 1, steps_per_frame)
        times = (before + number) * seconds, (before + number + 1) * seconds
        yield Stretch(first + frame, step / steps_per_frame, *times, first + following, next_step / steps_per_frame)
