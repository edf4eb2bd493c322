"""Curves and points on which usual methods fail: joints, wind, slanted sticks, balls in balls, many in one place.

The shapes are those of `benchmarks/generated_curves.py`. The usual method is a test in float, which solves for the cone
and for both balls by a formula and takes the nearest solution: it is wrong where terms cancel, and it shows surfaces
inside of a neighbour.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from benchmarks.generated_curves import (
    BenchBalls,
    blown,
    far_away,
    fur,
    nested_spheres,
    one_place,
    slanted_sticks,
    tips,
    zigzag,
)

F32 = npt.NDArray[np.float32]
Rays = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]


@dataclass(frozen=True, slots=True)
class RoundCase:
    """name: identifier. breaks: the failure elsewhere. states: the shapes, one after the other, always the same.

    loses_in_float: whether `cast_in_float` loses more than one in twenty hits that graze; trees fail on the others.
    """

    name: str
    breaks: str
    states: Callable[[], tuple[BenchBalls, ...]]
    loses_in_float: bool = True


def _in_wind() -> tuple[BenchBalls, ...]:
    hair = fur(0.002)
    return tuple(blown(hair, frame) for frame in range(4))


ROUND_CASES = (
    RoundCase(
        "joints_of_a_zigzag",
        "Where segments meet: gaps beside the cones, and balls whose insides show as surfaces.",
        lambda: (zigzag(),),
    ),
    RoundCase(
        "hair_in_the_wind", "The strands have moved and the boxes have not: rays meet hair where it was.", _in_wind
    ),
    RoundCase(
        "ball_of_sticks",
        "Boxes of slanted sticks are mostly air and all overlap, those of their sides as well.",
        lambda: (slanted_sticks(600),),
    ),
    RoundCase(
        "spheres_in_spheres",
        "Boxes in boxes, down to a millionth of the outermost: halves of equal number part nothing.",
        lambda: (nested_spheres(),),
        False,
    ),
    RoundCase(
        "points_in_one_place",
        "No plane parts them: splitting never ends, or the stack does; and any of them is hit.",
        lambda: (one_place(1000),),
        False,
    ),
    RoundCase(
        "tips_and_doubled_points",
        "Cones of no length or radius: 0 / 0 in the formulas, and balls that hold their neighbours.",
        lambda: (tips(),),
    ),
    RoundCase(
        "far_from_zero",
        "A thousand times as far from zero as large: the digits that tell the skin from the axis cancel.",
        lambda: (far_away(),),
    ),
)


def rays_at(balls: BenchBalls, count: int, seed: int) -> Rays:
    """Rays from around and inside towards balls' surfaces, so that many graze them; some axis-parallel."""
    random = np.random.default_rng(seed)
    chosen = random.integers(0, len(balls.points), count)
    size = float(np.ptp(balls.points, axis=0).max()) + float(balls.radii.max())
    way = random.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    grazing = random.uniform(0.0, 1.02, (count, 1)) * balls.radii[chosen, None]
    targets = balls.points[chosen].astype(np.float64) + grazing * way
    origins = targets + random.normal(size=(count, 3)) * size * random.choice([1e-2, 1.0, 3.0], (count, 1))
    directions = targets - origins
    directions[::7] = np.eye(3)[random.integers(0, 3, len(directions[::7]))]
    origins[::7] = targets[::7] - size * directions[::7]
    return origins, directions


def segments_of(balls: BenchBalls) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """First ball, last ball and number of the curve, or point, of each segment that has a radius."""
    first = np.arange(len(balls.points))
    if balls.offsets is None:
        last, numbers = first, first
    else:
        is_end = np.zeros(len(first), np.bool_)
        is_end[balls.offsets[1:] - 1] = True
        numbers = np.repeat(np.arange(len(balls.offsets) - 1), np.diff(balls.offsets))[~is_end]
        first = first[~is_end]
        last = first + 1
    kept = np.maximum(balls.radii[first], balls.radii[last]) > 0.0
    return first[kept], last[kept], numbers[kept]


def cast_in_float(balls: BenchBalls, rays: Rays) -> tuple[F32, npt.NDArray[np.int32]]:
    """The nearest hit of each ray by formulas in float, of all segments: t, inf for a miss, and whose it is, or -1."""
    first, last, numbers = segments_of(balls)
    (start, radius), (end, other) = ((balls.points[ends], balls.radii[ends]) for ends in (first, last))
    t_hit, ids = np.full(len(rays[0]), np.inf, np.float32), np.full(len(rays[0]), -1, np.int32)
    with np.errstate(all="ignore"):
        for row, (origin, direction) in enumerate(zip(*(part.astype(np.float32) for part in rays), strict=True)):
            from_start, axis, shrink = origin - start, end - start, radius - other
            spread = (axis * axis).sum(axis=1) - shrink * shrink
            along = axis @ direction
            offset = (axis * from_start).sum(axis=1) - shrink * radius
            square = (from_start * from_start).sum(axis=1) - radius * radius
            mixed = from_start @ direction
            cone = _roots(
                spread * (direction @ direction) - along * along,
                spread * mixed - along * offset,
                spread * square - offset * offset,
            )
            place = (offset + cone * along) / spread
            cone[~((place >= 0.0) & (place <= 1.0))] = np.inf
            both = [(mixed, square), ((origin - end) @ direction, ((origin - end) ** 2).sum(axis=1) - other * other)]
            found = np.concatenate([cone, *(_roots(direction @ direction, half, rest) for half, rest in both)], axis=0)
            found = np.where(found >= 0.0, found, np.inf).min(axis=0)
            nearest = int(np.argmin(found))
            if np.isfinite(found[nearest]):
                t_hit[row], ids[row] = found[nearest], numbers[nearest]
    return t_hit, ids


def lost(t_hit: F32, right: F32) -> npt.NDArray[np.bool_]:
    """Which rays are false hits or false misses, or are off by more than a thousandth."""
    is_hit = np.isfinite(right)
    with np.errstate(invalid="ignore"):
        is_off = np.abs(t_hit - right) > 1e-3 * np.abs(right)
    return np.asarray((np.isfinite(t_hit) != is_hit) | (is_hit & is_off))


def _roots(square: F32, half: F32, rest: F32) -> F32:
    """(2, S): where square t t + 2 half t + rest is 0."""
    root = np.sqrt(half * half - square * rest)
    return np.asarray(np.stack([(-half - root) / square, (-half + root) / square]))
