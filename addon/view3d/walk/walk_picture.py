"""What is drawn of one step of a ray's walk: lines and filled triangles with colours. Knows no Blender.

What the step does is bright, what was done before is faint, and what is to come is not there yet.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from perfect_bvh import WalkEvent

from ..box_lines import EDGES

if TYPE_CHECKING:
    from perfect_bvh import RayWalk

    from .walk_steps import WalkStep

Float32Array = npt.NDArray[np.float32]
Float64Array = npt.NDArray[np.float64]
Color = tuple[float, float, float]

ENTERED: Color = (1.0, 0.83, 0.2)
WAITING: Color = (0.3, 0.68, 1.0)  # hit by the ray, and not entered yet
MISSED: Color = (0.72, 0.72, 0.72)
PRUNED: Color = (0.93, 0.36, 0.86)
TESTED: Color = (1.0, 0.52, 0.12)
HIT: Color = (0.35, 1.0, 0.4)
RAY: Color = (1.0, 1.0, 1.0)

EVENT_COLORS = {
    WalkEvent.ENTER_NODE: ENTERED,
    WalkEvent.ENTER_LEAF: ENTERED,
    WalkEvent.ENTER_INSTANCE: ENTERED,
    WalkEvent.SKIP_INSTANCE: MISSED,
    WalkEvent.BOX_HIT: WAITING,
    WalkEvent.BOX_MISSED: MISSED,
    WalkEvent.BOX_PRUNED: PRUNED,
    WalkEvent.WAITING_PRUNED: PRUNED,
    WalkEvent.TRIANGLE_MISSED: TESTED,
    WalkEvent.TRIANGLE_REJECTED: TESTED,
    WalkEvent.TRIANGLE_HIT: HIT,
}
_ENTERING = (WalkEvent.ENTER_NODE, WalkEvent.ENTER_LEAF, WalkEvent.ENTER_INSTANCE)
# Opacities, and widths in points.
BRIGHT, BESIDE, FAINT, FILLED = 1.0, 0.5, 0.25, 0.55
MISSED_SHARE = 0.6  # of these: what the ray passes by is looked at last
THICK, WIDE, THIN = 3.0, 1.8, 1.0
# Of what was missed before nothing is left; of what was entered or tested before, the last ones.
MOST_EARLIER = 400


@dataclass(frozen=True, slots=True)
class Lines:
    """positions: (2N, 3) float32, ends of N lines. colors: (2N, 4) float32 RGBA. width: in points."""

    positions: Float32Array
    colors: Float32Array
    width: float


@dataclass(frozen=True, slots=True)
class Picture:
    """lines: the later ones over the earlier. triangles: (3N, 3) float32 with colors (3N, 4).

    tip: (3,), the end of the ray's bright part, which the eye that looks along the ray sees as a point. hit: (3,) or
    None.
    """

    lines: list[Lines]
    triangles: Float32Array
    triangle_colors: Float32Array
    tip: Float64Array
    hit: Float64Array | None


@dataclass(frozen=True, slots=True)
class WalkedRay:
    """A ray and what it does. origin, direction: (3,) float64, the latter of length one. exit: behind all boxes."""

    walk: RayWalk
    origin: Float64Array
    direction: Float64Array
    t_min: float
    exit: float
    corners: Float64Array  # (N, 8, 3), of each event's box in the world

    @classmethod
    def of(cls, walk: RayWalk, origin: Float64Array, direction: Float64Array, t_min: float) -> WalkedRay:
        """Of what the trees were asked for."""
        corners = walk.world_boxes()
        behind = max(float(((corners - origin) @ direction).max(initial=t_min)), t_min) * 1.05 + 1e-6
        return cls(walk, origin, direction, t_min, behind, corners)

    def end(self, row: int) -> float:
        """Where the ray ends after an event: at the nearest hit so far, or else behind all boxes."""
        return min(float(self.walk.nearest_t[row]), self.exit) if len(self.walk) else self.exit

    def at(self, t: float) -> Float64Array:
        """A point of the ray."""
        return self.origin + t * self.direction


def picture_of(ray: WalkedRay, step: WalkStep, row: int | None = None) -> Picture:
    """Of one step, which is one of this ray's. row: the only one of its rows that is bright; None for all."""
    walk, rows = ray.walk, step.rows
    span = span_in_box(ray, _spanned(ray, rows, row)) if len(rows) else (ray.t_min, ray.end(-1))
    is_now, is_beside = np.zeros(len(walk), bool), np.zeros(len(walk), bool)
    if row is None:
        is_now[rows.start : rows.stop] = True
    else:
        is_now[row] = is_beside[rows.start : row] = True
        is_beside[row] = False
    is_box = walk.primitive_ids < 0
    before = np.arange(len(walk)) < rows.start
    earlier = np.flatnonzero(before & np.isin(walk.events, _ENTERING))[-MOST_EARLIER:]
    lines = [
        _boxes(ray, earlier, FAINT, THIN),
        _boxes(ray, np.flatnonzero(is_beside & is_box)[::-1], BESIDE, THIN),
        _boxes(ray, np.flatnonzero(is_now & is_box)[::-1], BRIGHT, WIDE),  # the one that is entered over its children
        *_ray_lines(ray, rows.start if row is None else row, span),
    ]
    hits = np.flatnonzero((walk.events == WalkEvent.TRIANGLE_HIT) & (before | is_beside | is_now))
    shown = np.flatnonzero(is_now & ~is_box)
    if len(hits):
        shown = np.union1d(shown, hits[-1:])
    lines.insert(1, _outlines(ray, np.flatnonzero((before | is_beside) & ~is_box)[-MOST_EARLIER:]))
    colors = _colors(walk.events[shown], FILLED).repeat(3, axis=0)
    return Picture(
        lines=[part for part in lines if len(part.positions)],
        triangles=walk.triangles[shown].reshape(-1, 3).astype(np.float32),
        triangle_colors=colors,
        tip=ray.at(span[1]),
        hit=ray.at(float(walk.t[hits[-1]])) if len(hits) else None,
    )


def _boxes(ray: WalkedRay, rows: npt.NDArray[np.intp], opacity: float, width: float) -> Lines:
    ends = ray.corners[rows][:, EDGES.ravel()]
    colors = _colors(ray.walk.events[rows], opacity).repeat(EDGES.size, axis=0)
    return Lines(ends.reshape(-1, 3).astype(np.float32), colors, width)


def _outlines(ray: WalkedRay, rows: npt.NDArray[np.intp]) -> Lines:
    ends = ray.walk.triangles[rows][:, [0, 1, 1, 2, 2, 0]]
    colors = _colors(ray.walk.events[rows], FAINT).repeat(6, axis=0)
    return Lines(ends.reshape(-1, 3).astype(np.float32), colors, THIN)


def _colors(events: npt.NDArray[np.uint8], opacity: float) -> Float32Array:
    table = np.array([EVENT_COLORS[event] for event in WalkEvent], np.float32)
    shares = np.array([MISSED_SHARE if EVENT_COLORS[event] is MISSED else 1.0 for event in WalkEvent], np.float32)
    return np.concatenate([table[events], opacity * shares[events][:, None]], axis=1)


def _spanned(ray: WalkedRay, rows: range, row: int | None) -> int:
    """In whose box the ray is bright: what is missed or pruned has none of it."""
    return row if row is not None and ray.walk.events[row] == WalkEvent.BOX_HIT else rows.start


def _ray_lines(ray: WalkedRay, first: int, span: tuple[float, float]) -> list[Lines]:
    """As far as it goes before a row, and the part that is told of: that in a box, or the whole way."""
    whole = _line(ray, (ray.t_min, ray.end(first - 1) if first > 0 else ray.exit), 0.55, THIN)
    return [whole, _line(ray, span, BRIGHT, THICK)]


def _line(ray: WalkedRay, span: tuple[float, float], opacity: float, width: float) -> Lines:
    ends = np.stack([ray.at(t) for t in span]).astype(np.float32)
    return Lines(ends, np.full((2, 4), (*RAY, opacity), np.float32), width)


def span_in_box(ray: WalkedRay, row: int) -> tuple[float, float]:
    """From where to where a ray is in the box of an event, within what it has before it."""
    linear, place = ray.walk.transforms[row][:, :3], ray.walk.transforms[row][:, 3]
    if not abs(np.linalg.det(linear)) > 0.0:
        return ray.t_min, ray.t_min
    origin = np.linalg.solve(linear, ray.origin - place)
    direction = np.linalg.solve(linear, ray.direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        planes = (ray.walk.bounds[row] - origin) / direction
    planes = np.where(np.isnan(planes), [[-np.inf], [np.inf]], planes)  # along a face of the box
    first, last = float(planes.min(axis=0).max()), float(planes.max(axis=0).min())
    end = ray.end(row)
    first = min(max(first, ray.t_min), end)
    return first, min(max(last, first), end)
