"""Where rays may meet flat curves that face them, in the longest float, by formulas independent of the engine's.

Cross products give the nearest points of a ray's line and a segment's axis; beyond an end of the axis that end is
taken. A ribbon is met there if the ray passes no farther than the radius, unless the curve ends there and the nearest
place is beyond, or one of the neighbours' axes is nearer.

The rounding errors of double precision are equivalent to a shift of either ball by at most m (`round_world.py`'s
margin): so distances are known to m. With e the length of the axis as the ray sees it, the share of the axis is known
to m / e (2 + distance / e + |share|), and the bound is four times that; where e is less than 16 m any share is
possible.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .round_segments import Hulls, Real, Reals, dot, take
from .round_world import Flags, Ints, RoundWorld, mapped_rays, near_pairs

_OF_T = 2.0**-23
_LEAST_LENGTH, _SHARE_MARGIN = 16.0, 8.0


@dataclass(frozen=True)
class Meetings:
    """Of ray k with the ribbon of hull k, (P,): shares of the axis, and t there, lie between two bounds (P, 2)."""

    shares: Reals
    t: Reals
    distance: Reals
    margin: Reals

    @property
    def nearest(self) -> Reals:
        return np.maximum(self.distance - self.margin, 0.0)

    @property
    def farthest(self) -> Reals:
        return self.distance + self.margin


def nearest_shares(hulls: Hulls, origins: Reals, directions: Reals) -> tuple[Reals, Reals]:
    """The share of each axis, be it beyond its ends, and how long the axis looks; NaN along the axis."""
    axis, start = hulls.ends - hulls.starts, hulls.starts - origins
    across = np.cross(directions, axis)
    length = np.sqrt(dot(across, across) / dot(directions, directions))
    with np.errstate(divide="ignore", invalid="ignore"):
        return dot(np.cross(start, directions), across) / dot(across, across), length


def place(hulls: Hulls, origins: Reals, directions: Reals, shares: Reals) -> tuple[Reals, Reals]:
    """How far a ray passes the axis at a share of it, and at which t."""
    centre = hulls.starts + shares[:, None] * (hulls.ends - hulls.starts) - origins
    square = dot(directions, directions)
    across = np.cross(centre, directions)
    return np.sqrt(dot(across, across) / square), dot(centre, directions) / square


def meet(hulls: Hulls, origins: Reals, directions: Reals, margin: Reals) -> Meetings:
    share, length = nearest_shares(hulls, origins, directions)
    known = np.clip(np.where(np.isnan(share), 0.0, share), 0.0, 1.0)
    distance = place(hulls, origins, directions, known)[0]
    is_long = length > _LEAST_LENGTH * margin
    with np.errstate(divide="ignore", invalid="ignore"):
        off = _SHARE_MARGIN * margin / length * (1.0 + distance / length + np.abs(share))
    low, high = np.where(is_long, share - off, -1.0), np.where(is_long, share + off, 2.0)
    ends = [place(hulls, origins, directions, np.clip(bound, 0.0, 1.0))[1] for bound in (low, high)]
    slack = margin / np.sqrt(dot(directions, directions))
    t = np.stack([np.minimum(*ends) - slack, np.maximum(*ends) + slack], axis=1)
    return Meetings(np.stack([low, high], axis=1), t, distance, margin)


@dataclass(frozen=True)
class RibbonMeetings:
    """Pairs of a ray and a segment that it may meet, (P,), by rays and then segments.

    low, high: bounds of t. sure_low, sure_high: of a ribbon, this or one that may be nearer, that is_there: surely.
    is_own: surely there, and this segment's own.
    """

    rays: Ints
    segments: Ints
    low: npt.NDArray[np.float64]
    high: npt.NDArray[np.float64]
    sure_low: npt.NDArray[np.float64]
    sure_high: npt.NDArray[np.float64]
    is_there: Flags
    is_own: Flags


def find_meetings(world: RoundWorld, origins: npt.ArrayLike, directions: npt.ArrayLike) -> RibbonMeetings:
    """Finds the meetings of every ray, (R, 3) both, with every segment, ignoring masks."""
    rays, segments = near_pairs(world, origins, directions)
    own, may, sure = _judged(world, origins, directions, rays, segments)
    hidden, alone = np.zeros(len(rays), np.bool_), np.ones(len(rays), np.bool_)
    low, high, there = own.t[:, 0].copy(), own.t[:, 1].copy(), sure.copy()
    for step in (-1, 1):
        for here in world.beside(segments, step):
            other = _judged(world, origins, directions, rays, np.maximum(here, 0))[0]
            hidden |= (here >= 0) & (other.farthest < own.nearest)
            alone &= (here < 0) | (other.nearest > own.farthest)
        here, reach = world.next_hull(segments, step), own.farthest.copy()
        active = may & (here >= 0)
        while active.any():
            other, _, other_sure = _judged(world, origins, directions, rays, np.maximum(here, 0))
            active &= other.nearest <= reach
            alone &= ~active
            there &= ~active | other_sure
            low = np.where(active, np.minimum(low, other.t[:, 0]), low)
            high = np.where(active, np.maximum(high, other.t[:, 1]), high)
            reach, here = other.farthest, world.next_hull(here, step)
            active &= (here >= 0) & (here != segments)
    kept = may & ~hidden
    bounds = [own.t[:, 0], own.t[:, 1], low, high]
    signs = (-1.0, 1.0, -1.0, 1.0)
    rounded = [(b + s * np.abs(b) * _OF_T).astype(np.float64)[kept] for b, s in zip(bounds, signs, strict=True)]
    return RibbonMeetings(rays[kept], segments[kept], *rounded, there[kept], (there & alone)[kept])


def _judged(
    world: RoundWorld, origins: npt.ArrayLike, directions: npt.ArrayLike, rays: Ints, segments: Ints
) -> tuple[Meetings, Flags, Flags]:
    """Where, whether they may be met and whether they surely are, if no neighbour is nearer."""
    hulls = take(world.hulls, segments)
    found = meet(hulls, *mapped_rays(world, hulls, origins, directions, rays, segments))
    clipped = np.clip(found.shares, 0.0, 1.0)
    radii = hulls.first_radii[:, None] + clipped * (hulls.last_radii - hulls.first_radii)[:, None]
    cut_first, cut_last = world.before[segments] < 0, world.after[segments] < 0
    low, high = found.shares[:, 0], found.shares[:, 1]
    is_cut = (cut_first & (high < 0.0)) | (cut_last & (low > 1.0))
    may_be_cut = (cut_first & (low < 0.0)) | (cut_last & (high > 1.0))
    may = ~is_cut & (found.nearest <= radii.max(axis=1))
    return found, may, ~may_be_cut & (found.farthest <= radii.min(axis=1))


def ribbon_at(
    world: RoundWorld, ray: tuple[npt.ArrayLike, npt.ArrayLike], instance_id: int, primitive_id: int
) -> tuple[float, npt.NDArray[np.float64], npt.NDArray[np.float64]] | None:
    """Of the named curve where one ray meets it: u along it, the world's point, the rounded normal.

    None if the ray meets it in several places, being nearer to each than just before and after it, or in none.
    """
    rows = np.flatnonzero((world.instance_ids == instance_id) & (world.primitive_ids == primitive_id))
    hulls = take(world.hulls, rows)
    inverse = world.inverses[world.parts[rows[0]]]
    here, there = (np.asarray(part, Real) for part in ray)
    origin, direction = (inverse[:, :3] * here).sum(axis=1) + inverse[:, 3], (inverse[:, :3] * there).sum(axis=1)
    origins, directions = np.broadcast_to(origin, (len(rows), 3)), np.broadcast_to(direction, (len(rows), 3))
    exact = nearest_shares(hulls, origins, directions)[0]
    shares = np.clip(exact, 0.0, 1.0)
    distances, t = place(hulls, origins, directions, shares)
    is_least = np.ones(len(rows), np.bool_)
    for step in (-1, 1):
        for other in world.beside(rows, step):
            theirs = np.where(other >= 0, distances[np.maximum(other - rows[0], 0)], np.inf)
            is_least &= (distances < theirs) | ((distances == theirs) & (rows < other))
    radii = hulls.first_radii + shares * (hulls.last_radii - hulls.first_radii)
    is_cut = ((exact < 0.0) & (world.before[rows] < 0)) | ((exact > 1.0) & (world.after[rows] < 0))
    met = np.flatnonzero(is_least & (distances <= radii) & ~is_cut)
    if len(met) != 1:
        return None
    best = int(met[0])
    axes = hulls.ends - hulls.starts
    beside = (int(world.next_hull(rows[best : best + 1], step)[0]) for step in (-1, 1))
    before, after = (axes[other - rows[0]] if other >= 0 else axes[best] for other in beside)
    tangent = axes[best] + before + (after - before) * shares[best]
    centre = hulls.starts[best] + shares[best] * axes[best]
    side = origin + t[best] * direction - centre
    across = np.cross(tangent, direction)
    across *= np.sign(dot(across, side)) / np.sqrt(dot(across, across))
    back = -(direction - dot(direction, tangent) / dot(tangent, tangent) * tangent)
    back /= np.sqrt(dot(back, back))
    sine = distances[best] / radii[best]
    # Of the tube in the mesh's own space: the transposed inverse maps planes to the world.
    normal = ((sine * across + np.sqrt(1.0 - sine**2) * back)[:, None] * inverse[:, :3]).sum(axis=0)
    normal /= np.sqrt(dot(normal, normal))
    u = (world.steps[rows[best]] + shares[best]) / world.counts[rows[best]]
    return float(u), (here + t[best] * there).astype(np.float64), normal.astype(np.float64)
