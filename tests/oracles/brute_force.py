"""The judge: every ray against every triangle, in double precision, with an explicit bound of its own rounding error.

A triangle is *surely hit* by a ray if the ray passes inside all three of its edges by more than `margin`, *surely
missed* if it passes outside one of them by more than that, and *ambiguous* in between. The margin is the rounding error
of double precision on a ray's way into an instance's space and back: the engine's kernels decide in it wherever float
could be wrong. For peers, whose kernels use float only, it is the distance that rounding to float can move the ray.

An answer is right if
- it is a miss, and no triangle is surely hit within the ray's range; or
- it names a triangle that is not surely missed, with the oracle's t for it (within `t_bound`), and no surely hit
  triangle lies nearer than the answer by more than the two bounds.
Bounds: with u = 2^-24 and all lengths in world units, rounding the ray to float moves it by at most 4 u (M + |o|), M
the largest coordinate of the instance about its own origin or in the world, whichever is greater; double precision,
through matrices that squeeze by up to a hundred thousand, by at most 2^-36 (M + |o|). t of a surely hit triangle is
that of its plane, however large the triangle: right to 2 u |t|, plus the rounding error of double precision by M and
|o|. That of an ambiguous one may be where the moved ray is: the margin shows along the ray divided by |d| |cos| (the
angle of ray and normal).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

ULP = 2.0**-24
ROUNDING_OF_DOUBLES, ROUNDING_OF_FLOATS = 2.0**-36, 4.0 * ULP  # of M + |o|
_ROUNDING_OF_T = 2.0**-44  # the same, of t's plane in double precision
_PAIRS_AT_A_TIME = 100_000  # so that arrays of them stay in a core's cache

F64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class WorldTriangles:
    """corners: (T, 3, 3) world space. instance_ids, primitive_ids, masks: (T,).

    The margin is `rounding` of M + |o|; scale: (T,), its M.
    """

    corners: F64
    instance_ids: npt.NDArray[np.int64]
    primitive_ids: npt.NDArray[np.int64]
    masks: npt.NDArray[np.uint32]
    scale: F64
    rounding: float = ROUNDING_OF_DOUBLES

    @classmethod
    def of(
        cls,
        parts: list[tuple[int, npt.ArrayLike, npt.ArrayLike, npt.ArrayLike, int]],
        rounding: float = ROUNDING_OF_DOUBLES,
    ) -> WorldTriangles:
        """parts: (instance id, positions, triangles, (4, 4) transform, mask) for each instance."""
        corners, instances, primitives, masks, scales = [], [], [], [], []
        for instance_id, positions, triangles, transform, mask in parts:
            matrix = np.asarray(transform, np.float64)
            points = np.asarray(positions, np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
            rows = np.asarray(triangles).reshape(-1, 3)
            corners.append(points[rows])
            instances.append(np.full(len(rows), instance_id))
            primitives.append(np.arange(len(rows)))
            masks.append(np.full(len(rows), mask, np.uint32))
            size = max(np.abs(points).max(initial=0.0), np.abs(matrix[:3, 3]).max())
            scales.append(np.full(len(rows), size))
        return cls(
            np.concatenate(corners) if corners else np.empty((0, 3, 3)),
            np.concatenate(instances) if instances else np.empty(0, np.int64),
            np.concatenate(primitives) if primitives else np.empty(0, np.int64),
            np.concatenate(masks) if masks else np.empty(0, np.uint32),
            np.concatenate(scales) if scales else np.empty(0),
            rounding,
        )


@dataclass(frozen=True)
class Verdict:
    """wrong: (R,) bool. ambiguous: (R,) bool, rays for which some triangle was ambiguous (right answers included)."""

    wrong: npt.NDArray[np.bool_]
    ambiguous: npt.NDArray[np.bool_]
    hit: npt.NDArray[np.bool_]

    def __str__(self) -> str:
        return (
            f"{len(self.wrong)} rays, {int(self.hit.sum())} hits: {int(self.wrong.sum())} wrong, "
            f"{int(self.ambiguous.sum())} ambiguous; first wrong: {np.flatnonzero(self.wrong)[:5].tolist()}"
        )


@dataclass(frozen=True)
class _Block:
    t: F64
    t_bound: F64
    sure: npt.NDArray[np.bool_]
    missed: npt.NDArray[np.bool_]


def _classify(world: WorldTriangles, origins: F64, directions: F64) -> _Block:
    """Every ray of a block (R) against every triangle (T): arrays of shape (R, T).

    Lines are represented by their moments about zero, in products of matrices: the rounding error of that in double
    precision is four decimal places below the lesser margin.
    """
    length = np.linalg.norm(directions, axis=1)
    corners = world.corners
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    facing = directions @ normal.T
    cosine = np.abs(facing) / np.maximum(length[:, None] * area[None, :], 1e-300)
    reach = world.scale[None, :] + np.abs(origins).max(axis=1)[:, None]
    margin = world.rounding * reach
    with np.errstate(divide="ignore", invalid="ignore"):
        t = ((normal * corners[:, 0]).sum(axis=1) - origins @ normal.T) / facing
        t = np.where(np.isfinite(t), t, np.nan)  # in its own plane: nowhere and everywhere
        along = reach / (length[:, None] * cosine)
    turn = np.sign(facing)
    moment = np.cross(origins, directions)
    inside = np.full(t.shape, np.inf)
    for k in range(3):
        # The side from the corners themselves: q - p would lose the shape of a small triangle far from the origin.
        side = corners[:, (k + 1) % 3] - corners[:, k]
        volume = directions @ np.cross(corners[:, k], side).T + moment @ side.T
        edge = _lengths_of_crosses(side, directions)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = np.where(edge > 0.0, turn * volume / edge, 0.0)
        inside = np.minimum(inside, distance)
    # Seen almost edge-on the three distances say nothing about t: leave such triangles ambiguous.
    edge_on = ~np.isfinite(t) | (cosine < 1e-6) | (area[None, :] == 0.0)
    sure = (inside > margin) & ~edge_on
    t_bound = 2.0 * ULP * np.abs(t) + np.where(sure, _ROUNDING_OF_T, world.rounding) * along
    return _Block(t, t_bound, sure, (inside < -margin) & ~edge_on)


def _lengths_of_crosses(sides: F64, directions: F64) -> F64:
    """(R, T): the length of the cross product of each direction (R, 3) with each side (T, 3)."""
    squares = 0.0
    for i, j in ((0, 1), (1, 2), (2, 0)):
        squares = squares + (np.outer(directions[:, j], sides[:, i]) - np.outer(directions[:, i], sides[:, j])) ** 2
    return np.sqrt(squares)


@dataclass(frozen=True)
class _Part:
    """Some of the rays, judged: `visible` by their masks, `sure` within their ranges as well. low, high: (R, 1)."""

    rays: slice
    block: _Block
    visible: npt.NDArray[np.bool_]
    sure: npt.NDArray[np.bool_]
    low: F64
    high: F64


def _parts(
    world: WorldTriangles,
    origins: F64,
    directions: F64,
    t_min: npt.ArrayLike,
    t_max: npt.ArrayLike,
    mask: npt.ArrayLike,
) -> Iterator[_Part]:
    """All rays against all triangles, some rays at a time; none over no triangles."""
    count = len(origins)
    size = max(1, _PAIRS_AT_A_TIME // max(1, len(world.corners)))
    t_min, t_max, mask = (np.broadcast_to(np.asarray(v), (count,))[:, None] for v in (t_min, t_max, mask))
    for start in range(0, count if len(world.corners) else 0, size):
        rays = slice(start, min(count, start + size))
        block = _classify(world, origins[rays], directions[rays])
        low, high = t_min[rays], t_max[rays]
        visible = (world.masks[None, :] & mask[rays].astype(np.uint32)) != 0
        sure = block.sure & visible & (block.t - block.t_bound > low) & (block.t + block.t_bound < high)
        yield _Part(rays, block, visible, sure, low, high)


def certain_hits(
    world: WorldTriangles,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    t_min: npt.ArrayLike = 0.0,
    t_max: npt.ArrayLike = np.inf,
    mask: npt.ArrayLike = 0xFFFFFFFF,
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_], F64, F64]:
    """Returns, for every ray and triangle, (R, T): surely hit, possibly hit, t and its bound."""
    origins = np.asarray(origins, np.float64).reshape(-1, 3)
    directions = np.asarray(directions, np.float64).reshape(-1, 3)
    low, high, bits = (np.broadcast_to(np.asarray(v), (len(origins),))[:, None] for v in (t_min, t_max, mask))
    block = _classify(world, origins, directions)
    visible = (world.masks[None, :] & bits.astype(np.uint32)) != 0
    sure = block.sure & visible & (block.t - block.t_bound > low) & (block.t + block.t_bound < high)
    in_range = ~(block.t + block.t_bound < low) & ~(block.t - block.t_bound > high)  # NaN: edge-on, who knows
    return sure, ~block.missed & visible & in_range, block.t, block.t_bound


def judge(
    world: WorldTriangles,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    t_hit: npt.ArrayLike,
    instance_ids: npt.ArrayLike,
    primitive_ids: npt.ArrayLike,
    t_min: npt.ArrayLike = 0.0,
    t_max: npt.ArrayLike = np.inf,
    mask: npt.ArrayLike = 0xFFFFFFFF,
) -> Verdict:
    """Judges one answer a ray: origins, directions (R, 3); the rest (R,) or scalars. A miss has instance id -1."""
    origins = np.asarray(origins, np.float64).reshape(-1, 3)
    directions = np.asarray(directions, np.float64).reshape(-1, 3)
    count = len(origins)
    t_hit, instance_ids, primitive_ids = (np.asarray(v).reshape(-1) for v in (t_hit, instance_ids, primitive_ids))
    row_of = {
        key: i for i, key in enumerate(zip(world.instance_ids.tolist(), world.primitive_ids.tolist(), strict=True))
    }
    rows = np.array(
        [row_of.get(key, -1) for key in zip(instance_ids.tolist(), primitive_ids.tolist(), strict=True)], np.int64
    ).reshape(-1)
    hit = instance_ids >= 0
    wrong = hit & (rows < 0)  # names a triangle that does not exist
    ambiguous = np.zeros(count, np.bool_)
    for part in _parts(world, origins, directions, t_min, t_max, mask):
        block, rays = part.block, part.rays
        in_range = (block.t + block.t_bound >= part.low) & (block.t - block.t_bound <= part.high)
        possible = ~block.missed & part.visible & in_range
        ambiguous[rays] = (possible & ~part.sure).any(axis=1)
        nearest_sure = np.where(part.sure, block.t + block.t_bound, np.inf).min(axis=1)
        wrong[rays] |= ~hit[rays] & np.isfinite(nearest_sure)
        index = np.flatnonzero(hit[rays] & (rows[rays] >= 0))
        chosen = rows[rays][index]
        t, bound = block.t[index, chosen], block.t_bound[index, chosen]
        answered = t_hit[rays][index].astype(np.float64)
        known = np.isfinite(t) & np.isfinite(bound)
        bad = ~(part.visible[index, chosen] & ~block.missed[index, chosen])
        bad |= known & (np.abs(answered - t) > bound)
        bad |= answered - np.where(known, bound, 0.0) > nearest_sure[index]
        wrong[rays.start + index[bad]] = True
    return Verdict(wrong, ambiguous, hit)


def judge_occlusions(
    world: WorldTriangles,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    occluded: npt.ArrayLike,
    t_min: npt.ArrayLike = 0.0,
    t_max: npt.ArrayLike = np.inf,
    mask: npt.ArrayLike = 0xFFFFFFFF,
) -> Verdict:
    """Like `judge`, for answers that say only whether anything is on the ray: occluded (R,) bool."""
    origins = np.asarray(origins, np.float64).reshape(-1, 3)
    directions = np.asarray(directions, np.float64).reshape(-1, 3)
    count = len(origins)
    hit = np.asarray(occluded, np.bool_).reshape(-1)
    wrong, ambiguous = hit.copy(), np.zeros(count, np.bool_)  # over no triangles every hit is wrong
    for part in _parts(world, origins, directions, t_min, t_max, mask):
        block = part.block
        # Seen edge-on a triangle has no t to speak of: it may be hit anywhere.
        outside = (block.t + block.t_bound < part.low) | (block.t - block.t_bound > part.high)
        possible = ~block.missed & part.visible & ~outside
        ambiguous[part.rays] = (possible & ~part.sure).any(axis=1)
        wrong[part.rays] = np.where(hit[part.rays], ~possible.any(axis=1), part.sure.any(axis=1))
    return Verdict(wrong, ambiguous, hit)
