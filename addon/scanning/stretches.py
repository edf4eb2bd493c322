"""Cuts a scan into intervals from one time sample of the scene to the next. Does not depend on Blender."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from perfect_bvh._checks import check_count

from .patterns import Pattern

if TYPE_CHECKING:
    from perfect_bvh import Hits, Snapshot


@dataclass(frozen=True, slots=True)
class Stretch:
    """A part of the scan. frame: None for the current one. start, end: seconds since it began. next_...: its end.

    is_still: whether the scene and the sensor stand still in it.
    """

    frame: int | None
    subframe: float
    start: float
    end: float
    next_frame: int = 0
    next_subframe: float = 0.0
    is_still: bool = False


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
    whole_passes: bool = False,
) -> Iterator[Stretch]:
    """rate: frames a second. whole_passes: see `Scanner`. The rest: as `scan` takes it, which the errors name."""
    if frames is None:
        yield Stretch(None, 0.0, 0.0, pattern.duration, is_still=True)
        return
    first, last = frames
    if last < first:
        raise ValueError(f"scan: frames must be (first, last) with first <= last, got {frames}")
    check_count("scan", "steps_per_frame", steps_per_frame, 1)
    before = 0 if since is None else (first - since) * steps_per_frame
    if before < 0:
        raise ValueError(f"scan: since must be no later than the first of the frames {frames}, got {since}")
    if whole_passes and not pattern.needs_camera:
        for frame in range(first, last + 1):
            number = frame - (first if since is None else since)
            times = number * pattern.duration, (number + 1) * pattern.duration
            yield Stretch(frame, 0.0, *times, frame, is_still=True)
        return
    seconds = 1.0 / rate / steps_per_frame
    for number in range((last - first + 1) * steps_per_frame):
        frame, step = divmod(number, steps_per_frame)
        following, next_step = divmod(number + 1, steps_per_frame)
        times = (before + number) * seconds, (before + number + 1) * seconds
        yield Stretch(first + frame, step / steps_per_frame, *times, first + following, next_step / steps_per_frame)


# Poses ---------------------------------------------------------------------------------------------------------------
# The pose of a moving sensor: between two poses it moves in a straight line, and turns evenly the shorter way.


# How far from a rotation what turns one pose into the next may be: matrices of Blender are float32.
ROUNDING = 1e-4


@dataclass(frozen=True, slots=True)
class Path:
    """The path from one pose to the next. first, last: (4, 4) from the sensor's space to the world, without scale."""

    first: Float64Array
    last: Float64Array

    def place(
        self, origins: Float64Array, directions: Float64Array, shares: Float64Array
    ) -> tuple[Float64Array, Float64Array]:
        """(R, 3) origins and directions of the sensor's space in the world, each at its share, 0 to 1, of the way."""
        if np.array_equal(self.first, self.last):
            linear = self.first[:3, :3]
            return _turned(origins, linear) + self.first[:3, 3], _turned(directions, linear)
        way = self.first[:3, 3] + shares[:, None] * (self.last[:3, 3] - self.first[:3, 3])
        return self._turn(origins, shares) + way, self._turn(directions, shares)

    def undo(self, positions: Float64Array, shares: Float64Array) -> Float64Array:
        """(R, 3) positions of the world in the sensor's space, each at its share, 0 to 1, of the way."""
        nowhere = np.zeros_like(positions)
        axes = [self.place(nowhere, np.broadcast_to(axis, positions.shape), shares) for axis in np.eye(3)]
        return np.stack([_along(positions - origins, axis) for origins, axis in axes], axis=1)

    def _turn(self, vectors: Float64Array, shares: Float64Array) -> Float64Array:
        """Rotates by a share of the rotation from the first pose's axes to the last one's (Rodrigues' formula)."""
        start = self.first[:3, :3]
        between = np.linalg.solve(start, self.last[:3, :3])
        if np.abs(between @ between.T - np.eye(3)).max() > ROUNDING or np.linalg.det(between) < 0.0:
            straight = _turned(vectors, start)  # sheared or mirrored on the way: there is no rotation between them
            return straight + shares[:, None] * (_turned(vectors, self.last[:3, :3]) - straight)
        axis = np.array([between[2, 1] - between[1, 2], between[0, 2] - between[2, 0], between[1, 0] - between[0, 1]])
        sine, cosine = float(np.linalg.norm(axis)) / 2.0, (float(np.trace(between)) - 1.0) / 2.0
        if sine < ROUNDING**2:
            return _turned(vectors, start)
        axis /= 2.0 * sine
        angles = shares * np.arctan2(sine, cosine)
        along = axis * _along(vectors, axis)[:, None]
        across = np.cross(axis, vectors)
        turned = along + np.cos(angles)[:, None] * (vectors - along) + np.sin(angles)[:, None] * across
        return _turned(turned, start)


@dataclass(frozen=True, slots=True)
class Sweep:
    """A scanned stretch. rows: of the cloud, its points. path: the sensor's poses."""

    stretch: Stretch
    rows: slice
    path: Path


def _along(vectors: Float64Array, axis: Float64Array) -> Float64Array:
    """Returns (R,) the vectors' components along an axis, (3,), or each along its own, (R, 3).

    It does not use `@`: that calls a library that rounds differently on each processor, and starts threads.
    """
    return vectors[:, 0] * axis[..., 0] + vectors[:, 1] * axis[..., 1] + vectors[:, 2] * axis[..., 2]


def _turned(vectors: Float64Array, linear: Float64Array) -> Float64Array:
    """(R, 3) vectors through a (3, 3) matrix."""
    return np.stack([_along(vectors, row) for row in linear], axis=1)


def bend(before: Float64Array, here: Float64Array, after: Float64Array, distance: float) -> float:
    """How far points may be off for poses between which the true way is curved: three in a row, (4, 4).

    A curve leaves its chord by an eighth of its second difference; that of the directions counts at this distance.
    """
    second = before - 2.0 * here + after
    turning = float(np.linalg.norm(second[:3, :3], ord=2)) * distance
    # A rotation at an even speed bends, but is followed exactly.
    rate = float(np.linalg.norm(after[:3, :3] - before[:3, :3], ord=2)) / 2.0
    return (float(np.linalg.norm(second[:3, 3])) + max(turning - rate * rate * distance, 0.0)) / 8.0


# Second eye ----------------------------------------------------------------------------------------------------------
# Depth cameras with two cameras: a point counts if both see it.


Float64Array = npt.NDArray[np.float64]

# As a share of the distance to a point: a hit at or beyond it is the point's own surface.
ALMOST_THERE = 1.0 - 1e-5


def drop_hidden(
    hits: Hits, eyes: Float64Array, snapshot: Snapshot, mask: int, times: npt.ArrayLike, threads: int
) -> None:
    """Makes misses of hits that something hides from a second eye. eyes: (R, 3), where it is when each ray is cast."""
    ways = hits.positions - eyes
    how = {"mask": mask, "times": times, "threads": threads}
    is_hidden = snapshot.test_occlusions(eyes, ways, t_max=ALMOST_THERE, **how)
    hits.instance_ids[is_hidden & hits.is_hit] = -1
