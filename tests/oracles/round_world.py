"""Curves and points in instances, in double precision and beyond, and where rays may meet them.

A curve is the union of its segments, hulls of two balls of which consecutive ones share one (`round_segments.py`); a
point is a ball. Of a segment's interval along a ray, the entry is the curve's surface unless the segment before or
after holds it, and so is the exit. Strands that are no neighbours are not united. A cyclic curve's first and last
segments are neighbours, and so are those on both sides of segments whose two balls are equal.

The margin. The rounding errors of double precision are equivalent to a shift of the ray by at most m; a hull whose
radii are m less lies within any such hull, and one whose radii are m more around it. A ray *surely hits* the hull if it
hits the lesser, *surely misses* it if it misses the greater, and enters it between where it enters the one and the
other: that holds for tangents and tips as well. u = 2^-53, in the instance's own space: with N the inverse of its
matrix A, mapping a point p costs no more than 8 u |N| |A| |N| (|p| + |translation|), component by component, and a
direction the same, times the t of the hit. Being subtracted from a ball's middle, and setting up the equation, cost no
more than 24 u (largest coordinate + distance of the origin).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .round_segments import Hulls, Real, Reals, dot, intervals, take

Ints = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

_UNIT = 2.0**-53
_OF_MAPPING, _OF_SOLVING = 8.0 * _UNIT, 24.0 * _UNIT
_OF_T = 2.0**-23  # t is rounded to float
_PAIRS_AT_A_TIME = 200_000


class RoundPart(NamedTuple):
    """An instance: centres (N, 3) and radii (N,) as the engine holds them, in float; offsets (C + 1,), None: points.

    cyclic: (C,), which curves go on from their last ball, equal to their first; None: none.
    """

    instance_id: int
    centres: npt.ArrayLike
    radii: npt.ArrayLike
    offsets: npt.ArrayLike | None
    transform: npt.ArrayLike
    mask: int
    cyclic: npt.ArrayLike | None = None


@dataclass(frozen=True)
class RoundWorld:
    """Columns of all segments of all instances, in the order of the parts and along each curve.

    shape: "round", or "ribbon": flat and turned to rays (`ribbon_world.py`).
    hulls: in instances' own space. primitive_ids: the curve's or point's number in its mesh; steps: the segment's
    number in its curve; counts: of the curve's segments. before, after: the rows of the next segments of the same
    curve, or -1; is_ball: whether both balls are equal. parts: which row of inverses (I, 3, 4), losses (I, 3, 3) and
    shifts (I, 3), by which margins are reckoned.
    """

    hulls: Hulls
    parts: Ints
    instance_ids: Ints
    primitive_ids: Ints
    steps: Ints
    counts: Ints
    before: Ints
    after: Ints
    is_ball: Flags
    masks: npt.NDArray[np.uint32]
    inverses: Reals
    losses: Reals
    shifts: Reals
    shape: str = "round"

    @classmethod
    def of(cls, parts: list[RoundPart], shape: str = "round") -> RoundWorld:
        """Segments and points without any radius are not there, and hide nothing."""
        columns: list[tuple[npt.NDArray[np.generic] | Hulls, ...]] = []
        begin = 0
        maps = [_inverse_and_loss(part.transform) for part in parts]
        for row, part in enumerate(parts):
            centres, radii = np.asarray(part.centres, Real).reshape(-1, 3), np.asarray(part.radii, Real).reshape(-1)
            first, last, primitives, steps, counts = _segments_of(part.offsets, len(centres))
            kept = np.maximum(radii[first], radii[last]) > 0.0
            first, last, primitives, steps, counts = (c[kept] for c in (first, last, primitives, steps, counts))
            hulls = Hulls.of(centres[first], centres[last], np.stack([radii[first], radii[last]], axis=1))
            size = len(first)
            ids, masks = np.full(size, part.instance_id), np.full(size, part.mask, np.uint32)
            before, after = _neighbours_of(primitives, steps, counts, part.cyclic)
            rows = [np.where(near < 0, -1, near + begin) for near in (before, after)]
            is_ball = (hulls.starts == hulls.ends).all(axis=1) & (hulls.first_radii == hulls.last_radii)
            columns.append((hulls, np.full(size, row), ids, primitives, steps, counts, *rows, is_ball, masks))
            begin += size
        hulls = Hulls(
            *(
                np.concatenate([getattr(c[0], name) for c in columns])
                for name in ("starts", "ends", "first_radii", "last_radii")
            )
        )
        flat = [np.concatenate(list(column)) for column in list(zip(*columns, strict=True))[1:]]
        return cls(hulls, *flat, *(np.stack(arrays) for arrays in zip(*maps, strict=True)), shape)

    def beside(self, segments: Ints, step: int) -> Iterator[Ints]:
        """Yields the row, or -1, of the segment after (step 1) or before (-1) each one; goes on past balls.

        These are all that can hide the segment on that side.
        """
        column = self.after if step > 0 else self.before
        other = column[segments]
        while (other >= 0).any():
            yield other
            goes_on = (other >= 0) & self.is_ball[other]
            following = column[other]
            other = np.where(goes_on & (following != segments), following, -1)

    def next_hull(self, segments: Ints, step: int) -> Ints:
        """The row of the next segment that is more than a ball, or -1, also of rows that are -1."""
        found = np.full(len(segments), -1)
        for other in self.beside(np.maximum(segments, 0), step):
            found = np.where((segments >= 0) & (other >= 0) & ~self.is_ball[other], other, found)
        return found


def _neighbours_of(curves: Ints, steps: Ints, counts: Ints, cyclic: npt.ArrayLike | None) -> tuple[Ints, Ints]:
    """Looks for the segment with the next number in the same curve; in a cyclic one 0 follows the last."""
    rows = {key: row for row, key in enumerate(zip(curves.tolist(), steps.tolist(), strict=True))}
    closed = np.zeros(len(curves), np.bool_) if cyclic is None else np.asarray(cyclic, np.bool_)[curves]
    before, after = np.full(len(curves), -1), np.full(len(curves), -1)
    for (curve, step), row in rows.items():
        count = int(counts[row])
        following = 0 if closed[row] and step + 1 == count else step + 1
        other = rows.get((curve, following), row)
        if other != row:
            after[row], before[other] = other, row
    return before, after


def _segments_of(offsets: npt.ArrayLike | None, ball_count: int) -> tuple[Ints, Ints, Ints, Ints, Ints]:
    """First ball, last ball, curve, number in the curve and the curve's count, each (S,)."""
    if offsets is None:
        every = np.arange(ball_count)
        return every, every, every, np.zeros(ball_count, np.int64), np.ones(ball_count, np.int64)
    starts = np.asarray(offsets, np.int64)
    counts = np.diff(starts) - 1
    curves = np.repeat(np.arange(len(counts)), counts)
    steps = np.arange(len(curves)) - np.repeat(np.cumsum(counts) - counts, counts)
    first = starts[curves] + steps
    return first, first + 1, curves, steps, counts[curves]


def _inverse_and_loss(transform: npt.ArrayLike) -> tuple[Reals, Reals, Reals]:
    """(3, 4), the inverse map; (3, 3), |N| |A| |N|; (3,), |translation|."""
    matrix = np.asarray(transform, Real)
    a, b, c = matrix[:3, 0], matrix[:3, 1], matrix[:3, 2]
    rows = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
    inverse = rows / dot(a, rows[0])
    loss = _product(_product(np.abs(inverse), np.abs(matrix[:3, :3])), np.abs(inverse))
    shift = matrix[:3, 3]
    return np.column_stack([inverse, -_product(inverse, shift[:, None])[:, 0]]), loss, np.abs(shift)


def _product(a: Reals, b: Reals) -> Reals:
    return np.asarray((a[..., :, :, None] * b[..., None, :, :]).sum(axis=-2))


def _mapped(matrices: Reals, vectors: Reals) -> Reals:
    """Row k of (P, 3, 3) times row k of (P, 3)."""
    return np.asarray((matrices * vectors[:, None, :]).sum(axis=-1))


@dataclass(frozen=True)
class Chords:
    """Pairs of a ray and a segment that it may hit, by rays and then segments.

    entries, exits: (P, 2), t of the ray, from where to where each may be; is_sure: surely hit. Of a segment that is
    not, both may be anywhere that the greater hull is.
    """

    rays: Ints
    segments: Ints
    entries: npt.NDArray[np.float64]
    exits: npt.NDArray[np.float64]
    is_sure: Flags


def find_chords(world: RoundWorld, origins: npt.ArrayLike, directions: npt.ArrayLike) -> Chords:
    """Finds the chords of every ray, (R, 3) both, with every segment, ignoring masks."""
    origins, directions = (np.asarray(rows, np.float64).reshape(-1, 3) for rows in (origins, directions))
    size = max(1, _PAIRS_AT_A_TIME // max(1, len(world.parts)))
    found = []
    for start in range(0, len(origins), size):
        rays, segments = _near_pairs(world, origins[start : start + size], directions[start : start + size])
        found.append(_chords(world, origins, directions, rays + start, segments))
    if not found:
        nothing, none = np.empty(0, np.int64), np.empty((0, 2))
        return Chords(nothing, nothing, none, none, np.empty(0, np.bool_))
    return Chords(*(np.concatenate([getattr(c, name) for c in found]) for name in Chords.__dataclass_fields__))


def _near_pairs(world: RoundWorld, origins: npt.NDArray[np.float64], directions: npt.NDArray[np.float64]) -> tuple:
    """Filters pairs whose line passes the axis closer than the larger radius, plus 1e-9 of the magnitudes involved."""
    near = np.zeros((len(origins), len(world.parts)), np.bool_)
    for part in np.unique(world.parts):
        mine = np.flatnonzero(world.parts == part)
        inverse = world.inverses[part].astype(np.float64)
        start = (world.hulls.starts[mine].astype(np.float64))[None] - (origins @ inverse[:, :3].T + inverse[:, 3])[
            :, None
        ]
        along = directions @ inverse[:, :3].T
        along = (along / np.linalg.norm(along, axis=1, keepdims=True))[:, None]
        axis = (world.hulls.ends[mine] - world.hulls.starts[mine]).astype(np.float64)[None]
        off = start - np.einsum("rsk,rsk->rs", start, np.broadcast_to(along, start.shape))[..., None] * along
        step = axis - np.einsum("rsk,rsk->rs", *np.broadcast_arrays(axis, along))[..., None] * along
        square = np.einsum("rsk,rsk->rs", step, step)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(square > 0.0, -np.einsum("rsk,rsk->rs", off, step) / square, 0.0)
        distance = np.linalg.norm(off + np.clip(share, 0.0, 1.0)[..., None] * step, axis=-1)
        radius = np.maximum(world.hulls.first_radii[mine], world.hulls.last_radii[mine]).astype(np.float64)
        # Seen almost along the axis, the share is not known: the distance is right for some place of the axis.
        slack = 1e-9 * (np.abs(start).max(axis=-1) + np.abs(axis).max(axis=-1))
        near[:, mine] = distance <= radius[None] + slack
    rays, segments = np.nonzero(near)
    return rays, segments


def near_pairs(world: RoundWorld, origins: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[Ints, Ints]:
    """Rays and the segments that they may meet, by rays and then segments."""
    origins, directions = (np.asarray(rows, np.float64).reshape(-1, 3) for rows in (origins, directions))
    size = max(1, _PAIRS_AT_A_TIME // max(1, len(world.parts)))
    found = [(np.empty(0, np.int64), np.empty(0, np.int64))]
    for start in range(0, len(origins), size):
        rays, segments = _near_pairs(world, origins[start : start + size], directions[start : start + size])
        found.append((rays + start, segments))
    rays, segments = (np.concatenate(column) for column in zip(*found, strict=True))
    return rays, segments


def mapped_rays(
    world: RoundWorld, hulls: Hulls, origins: npt.ArrayLike, directions: npt.ArrayLike, rays: Ints, segments: Ints
) -> tuple[Reals, Reals, Reals]:
    """Returns, for each pair, the ray's origin and direction in the segment's own space, and the margin."""
    part = world.parts[segments]
    here, there = (np.asarray(rows, Real).reshape(-1, 3)[rays] for rows in (origins, directions))
    turn = world.inverses[part][:, :, :3]
    origin, direction = _mapped(turn, here) + world.inverses[part][:, :, 3], _mapped(turn, there)
    return origin, direction, _margins(world, hulls, part, here, there, origin, direction)


def _chords(world: RoundWorld, origins: npt.ArrayLike, directions: npt.ArrayLike, rays: Ints, segments: Ints) -> Chords:
    hulls = take(world.hulls, segments)
    origin, direction, margin = mapped_rays(world, hulls, origins, directions, rays, segments)
    near_out, far_out = intervals(hulls, origin, direction, margin)
    near_in, far_in = intervals(hulls, origin, direction, -margin)
    hit = ~np.isnan(near_out)
    sure = ~np.isnan(near_in) & hit
    entries = np.stack([near_out, np.where(sure, near_in, far_out)], axis=1)[hit]
    exits = np.stack([np.where(sure, far_in, near_out), far_out], axis=1)[hit]
    for bounds in (entries, exits):
        bounds += np.abs(bounds) * np.array([-_OF_T, _OF_T])
    return Chords(rays[hit], segments[hit], entries.astype(np.float64), exits.astype(np.float64), sure[hit])


def _margins(
    world: RoundWorld, hulls: Hulls, part: Ints, here: Reals, there: Reals, origin: Reals, direction: Reals
) -> Reals:
    """(P,): m of the module's docstring."""
    size = np.maximum(np.abs(hulls.starts), np.abs(hulls.ends)).max(axis=1)
    radius = np.maximum(hulls.first_radii, hulls.last_radii)
    away = np.maximum(np.abs(hulls.starts - origin), np.abs(hulls.ends - origin)).max(axis=1) + radius
    length = np.sqrt(dot(direction, direction))
    of_point = _mapped(world.losses[part], np.abs(here) + world.shifts[part]).max(axis=1)
    of_direction = _mapped(world.losses[part], np.abs(there)).max(axis=1) / length * 2.0 * away
    return np.asarray(_OF_MAPPING * (of_point + of_direction) + _OF_SOLVING * (size + radius + away))
