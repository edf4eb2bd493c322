"""The judge of rays' answers about curves and points: `brute_force.py` for `round_world.py`'s surfaces.

An answer is right if it names a curve that may have a surface at its t, and no surface that is surely there lies
nearer; a miss, if there is surely none. Where two segments meet, which of them has the surface is often not to be
known, but that one has it: if a segment is surely hit and a neighbour may hide its entry, that neighbour's entry, or
that of the next, is a surface no later. So a surface is surely there between the least entry of those that may hide
one another and the segment's own; and likewise, turned around, for exits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .brute_force import Verdict
from .ribbon_world import find_meetings
from .round_segments import Real, dot, take, touching
from .round_world import Chords, Flags, Ints, RoundWorld, find_chords

F64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Surfaces:
    """Where rays may meet surfaces, (K,): entries and exits of segments, unless surely hidden.

    low, high: bounds of t. is_there: of a surface, this or one that hides it, that is surely there; within sure_low and
    sure_high. is_own: surely there, and this segment's own. is_entry: or else an exit.
    """

    rays: Ints
    segments: Ints
    low: F64
    high: F64
    sure_low: F64
    sure_high: F64
    is_there: Flags
    is_own: Flags
    is_entry: Flags


def find_surfaces(world: RoundWorld, origins: npt.ArrayLike, directions: npt.ArrayLike) -> Surfaces:
    """All intersections of rays, in either direction along them, ignoring masks and ranges."""
    if world.shape == "ribbon":
        met = find_meetings(world, origins, directions)
        columns = (met.low, met.high, met.sure_low, met.sure_high, met.is_there, met.is_own)
        return Surfaces(met.rays, met.segments, *columns, np.ones(len(met.rays), np.bool_))
    chords = find_chords(world, origins, directions)
    may_entry, sure_entry, least = _hidden(world, chords, chords.entries, chords.exits)
    may_exit, sure_exit, most = _hidden(world, chords, -chords.exits[:, ::-1], -chords.entries[:, ::-1])
    parts = []
    for is_entry, t, may, sure in (
        (True, chords.entries, may_entry, sure_entry),
        (False, chords.exits, may_exit, sure_exit),
    ):
        sure_low, sure_high = (least, t[:, 1]) if is_entry else (t[:, 0], -most)
        columns = (chords.rays, chords.segments, t[:, 0], t[:, 1], sure_low, sure_high, chords.is_sure)
        own, kind = chords.is_sure & ~may, np.full(len(may), is_entry)
        parts.append([column[~sure] for column in (*columns, own, kind)])
    return Surfaces(*(np.concatenate(pair) for pair in zip(*parts, strict=True)))


def _hidden(world: RoundWorld, chords: Chords, entries: F64, exits: F64) -> tuple[Flags, Flags, F64]:
    """Returns whether each chord's entry may be, and surely is, hidden; the least entry of those that may hide it."""
    count = len(entries)
    may, sure = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    least = entries[:, 0].copy()
    for step in (-1, 1):
        ways = []
        for segments in world.beside(chords.segments, step):
            other, is_beside = _chords_of(world, chords, segments)
            in_way = is_beside & (entries[other, 0] <= entries[:, 1]) & (entries[:, 0] <= exits[other, 1])
            may |= in_way
            both = is_beside & chords.is_sure & chords.is_sure[other]
            sure |= both & (entries[other, 1] < entries[:, 0]) & (entries[:, 1] <= exits[other, 0])
            ways.append((other, in_way))
        reach = entries[:, 0].copy()
        while True:
            further = reach
            for other, in_way in ways:
                further = np.where(in_way, np.minimum(further, further[other]), further)
            if np.array_equal(further, reach):
                break
            reach = further
        least = np.minimum(least, reach)
    return may, sure, least


def _chords_of(world: RoundWorld, chords: Chords, segments: Ints) -> tuple[Ints, Flags]:
    """The chord of each chord's ray with another segment, and whether there is one; none with segment -1."""
    count = len(world.steps)
    keys = chords.rays * count + chords.segments  # they ascend
    wanted = chords.rays * count + segments
    other = np.minimum(np.searchsorted(keys, wanted), max(0, len(keys) - 1))
    return other, (segments >= 0) & (keys[other] == wanted)


@dataclass(frozen=True)
class _InRange:
    possible: Flags
    certain: Flags


def _in_range(
    world: RoundWorld, surfaces: Surfaces, t_min: npt.ArrayLike, t_max: npt.ArrayLike, mask: npt.ArrayLike, count: int
) -> _InRange:
    low, high, bits = (np.broadcast_to(np.asarray(v), (count,))[surfaces.rays] for v in (t_min, t_max, mask))
    visible = (world.masks[surfaces.segments] & bits.astype(np.uint32)) != 0
    possible = visible & (surfaces.high >= low) & (surfaces.low <= high)
    return _InRange(possible, visible & surfaces.is_there & (surfaces.sure_low > low) & (surfaces.sure_high < high))


def judge(
    world: RoundWorld,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    t_hit: npt.ArrayLike,
    instance_ids: npt.ArrayLike,
    primitive_ids: npt.ArrayLike,
    t_min: npt.ArrayLike = 0.0,
    t_max: npt.ArrayLike = np.inf,
    mask: npt.ArrayLike = 0xFFFFFFFF,
) -> Verdict:
    """One answer a ray, as `brute_force.judge` takes them; primitive ids are those of curves or points."""
    t_hit, instance_ids, primitive_ids = (np.asarray(v).reshape(-1) for v in (t_hit, instance_ids, primitive_ids))
    count = len(t_hit)
    surfaces = find_surfaces(world, origins, directions)
    within = _in_range(world, surfaces, t_min, t_max, mask, count)
    rays = surfaces.rays
    nearest_sure = np.full(count, np.inf)
    np.minimum.at(nearest_sure, rays[within.certain], surfaces.sure_high[within.certain])
    t = t_hit.astype(np.float64)[rays]
    named = (world.instance_ids[surfaces.segments] == instance_ids[rays]) & (
        world.primitive_ids[surfaces.segments] == primitive_ids[rays]
    )
    fits = np.zeros(count, np.bool_)
    fits[rays[within.possible & named & (surfaces.low <= t) & (t <= surfaces.high)]] = True
    hit = instance_ids >= 0
    wrong = np.where(hit, ~fits | (t_hit.astype(np.float64) > nearest_sure), np.isfinite(nearest_sure))
    ambiguous = np.zeros(count, np.bool_)
    ambiguous[rays[within.possible & ~within.certain]] = True
    return Verdict(wrong, ambiguous, hit)


def judge_occlusions(
    world: RoundWorld,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    occluded: npt.ArrayLike,
    t_min: npt.ArrayLike = 0.0,
    t_max: npt.ArrayLike = np.inf,
    mask: npt.ArrayLike = 0xFFFFFFFF,
) -> Verdict:
    """Like `judge`, for answers that say only whether anything is on the ray: occluded (R,) bool."""
    hit = np.asarray(occluded, np.bool_).reshape(-1)
    surfaces = find_surfaces(world, origins, directions)
    within = _in_range(world, surfaces, t_min, t_max, mask, len(hit))
    possible, certain, ambiguous = (np.zeros(len(hit), np.bool_) for _ in range(3))
    possible[surfaces.rays[within.possible]] = True
    certain[surfaces.rays[within.certain]] = True
    ambiguous[surfaces.rays[within.possible & ~within.certain]] = True
    return Verdict(np.where(hit, ~possible, certain), ambiguous, hit)


def judge_lists(
    world: RoundWorld,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    rays: npt.ArrayLike,
    t_hit: npt.ArrayLike,
    instance_ids: npt.ArrayLike,
    primitive_ids: npt.ArrayLike,
    t_min: npt.ArrayLike = 0.0,
    t_max: npt.ArrayLike = np.inf,
    mask: npt.ArrayLike = 0xFFFFFFFF,
) -> Verdict:
    """All intersections of rays, (L,) each, `rays` the number of the ray: each may be one, and each sure one is there.

    Nor may there be more of a ray than there are surfaces that it may meet.
    """
    rays, t_hit, instance_ids, primitive_ids = (
        np.asarray(v).reshape(-1) for v in (rays, t_hit, instance_ids, primitive_ids)
    )
    surfaces = find_surfaces(world, origins, directions)
    count = len(np.asarray(origins).reshape(-1, 3))
    within = _in_range(world, surfaces, t_min, t_max, mask, count)
    wrong, ambiguous = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    ambiguous[surfaces.rays[within.possible & ~(within.certain & surfaces.is_own)]] = True
    wrong |= np.bincount(rays, minlength=count) > np.bincount(surfaces.rays[within.possible], minlength=count)
    lists = np.split(np.argsort(rays, kind="stable"), np.cumsum(np.bincount(rays, minlength=count))[:-1])
    mine = np.split(
        np.arange(len(surfaces.rays))[np.argsort(surfaces.rays, kind="stable")],
        np.cumsum(np.bincount(surfaces.rays, minlength=count))[:-1],
    )
    for ray, (given, there) in enumerate(zip(lists, mine, strict=True)):
        t = t_hit[given].astype(np.float64)[:, None]
        of = surfaces.segments[there]
        fits = (world.instance_ids[of] == instance_ids[given][:, None]) & (
            world.primitive_ids[of] == primitive_ids[given][:, None]
        )
        fits &= within.possible[there] & (surfaces.low[there] <= t) & (t <= surfaces.high[there])
        needed = within.certain[there] & surfaces.is_own[there]
        wrong[ray] |= not fits.any(axis=1).all() or not fits[:, needed].any(axis=0).all()
    return Verdict(wrong, ambiguous, np.bincount(rays, minlength=count) > 0)


def surfaces_at(
    world: RoundWorld, points: npt.ArrayLike, instance_ids: npt.ArrayLike, primitive_ids: npt.ArrayLike
) -> tuple[F64, F64, F64]:
    """Of the named curve or point k at the world's point k of (P, 3): u along the whole of it, unit normal, distance.

    The distance is that of the nearest segment's surface, in the instance's own space, negative inside.
    """
    places = np.asarray(points, Real).reshape(-1, 3)
    u, normals, least = np.zeros(len(places)), np.zeros((len(places), 3)), np.full(len(places), np.inf)
    for k, (instance, primitive) in enumerate(zip(np.ravel(instance_ids), np.ravel(primitive_ids), strict=True)):
        rows = np.flatnonzero((world.instance_ids == instance) & (world.primitive_ids == primitive))
        inverse = world.inverses[world.parts[rows[0]]]
        place = (inverse[:, :3] * places[k]).sum(axis=1) + inverse[:, 3]
        s, normal, distance = touching(take(world.hulls, rows), np.broadcast_to(place, (len(rows), 3)))
        best = int(np.argmin(np.abs(distance)))
        is_point = bool((world.hulls.starts[rows[best]] == world.hulls.ends[rows[best]]).all())
        u[k] = 0.0 if is_point else (world.steps[rows[best]] + s[best]) / world.counts[rows[best]]
        turned = (inverse[:, :3] * normal[best][:, None]).sum(axis=0)
        normals[k] = turned / np.sqrt(dot(turned, turned))
        least[k] = distance[best]
    return u, normals, least
