"""The paths of a beam's light: from surface to surface, all rays of a batch at once. Does not depend on Blender.

At each surface a ray leaves an echo, the light that returns straight along its path, and continues: through alpha and
thin glass along its own line, refracted in thick glass, and mirrored. Light returns along the same path, so all shares
count twice.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..patterns import Float64Array
from ..stretches import drop_hidden
from .model import Optics, dot, length_of, unit
from .reflectance import Surfaces
from .surface_reader import SurfaceReader

if TYPE_CHECKING:
    from perfect_bvh import Hits, Snapshot

FIELDS = (
    *("t_hit", "instance_ids", "mesh_ids", "primitive_ids", "primitive_uvs"),
    *("geometric_normals", "positions", "distances"),
)
# Ways that give back less of the light than that are given up, and so are echoes: images' alpha is never quite 0.
LEAST_SHARE = 1e-6
# In parts of coordinates: the distance that a ray skips when it leaves a surface, so that it misses its neighbours.
STEP_OFF = 1e-6


@dataclass(frozen=True, slots=True)
class Cast:
    """The data for casting the R rays of a batch.

    times: (R,) of the queries. farthest: (R,) the largest length of light's path, in world units. eyes: (R, 3) of a
    second eye.
    """

    snapshot: Snapshot
    surfaces: SurfaceReader
    optics: Optics
    mask: int
    threads: int
    times: Float64Array
    farthest: Float64Array
    eyes: Float64Array | None = None


@dataclass(frozen=True, slots=True)
class Ways:
    """W rays under way.

    rows: (W,) which of the batch's. origins, directions: (W, 3), float64. lows, highs: (W,), the range, in multiples of
    the directions. before: (W,) how far the light has come before the origins. indices: (W,) of refraction, where it is
    now. shares: (W,) of the light that gets here and back. are_straight: (W,) whether it is still on its first line.
    """

    rows: npt.NDArray[np.int64]
    origins: Float64Array
    directions: Float64Array
    lows: npt.NDArray[np.float32]
    highs: Float64Array
    before: Float64Array
    indices: Float64Array
    shares: Float64Array
    are_straight: npt.NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.rows)

    def part(self, rows: npt.NDArray[Any]) -> Ways:
        """Some of them."""
        return Ways(**{field.name: getattr(self, field.name).take(rows, axis=0) for field in fields(self)})


@dataclass(frozen=True, slots=True)
class Arrivals:
    """A hits of rays.

    rows: (A,) the rays' rows in the batch. ranges: (A,) float64, the length of the light's path, in world units.
    energies: (A,) float64, the returned light, in parts of that of white paper. The rest describes the surface, as
    `perfect_bvh.Hits` has it; directions: (A, 3), of the rays that hit it. are_straight: (A,) whether it is on the
    original ray's line. bounces: (A,) the number of surfaces that the light had passed, or was mirrored by, before.
    """

    rows: npt.NDArray[np.int64]
    ranges: Float64Array
    energies: Float64Array
    positions: Float64Array
    normals: npt.NDArray[np.float32]
    directions: Float64Array
    instance_ids: npt.NDArray[np.int32]
    mesh_ids: npt.NDArray[np.int32]
    primitive_ids: npt.NDArray[np.int32]
    are_straight: npt.NDArray[np.bool_]
    bounces: npt.NDArray[np.int32]

    @classmethod
    def joined(cls, parts: Sequence[Arrivals]) -> Arrivals:
        """One after the other."""
        every = (_NOTHING, *parts)
        names = [field.name for field in fields(cls)]
        return cls(**{name: np.concatenate([getattr(part, name) for part in every]) for name in names})


_NOTHING = Arrivals(
    rows=np.empty(0, np.int64),
    ranges=np.empty(0),
    energies=np.empty(0),
    positions=np.empty((0, 3)),
    normals=np.empty((0, 3), np.float32),
    directions=np.empty((0, 3)),
    instance_ids=np.empty(0, np.int32),
    mesh_ids=np.empty(0, np.int32),
    primitive_ids=np.empty(0, np.int32),
    are_straight=np.empty(0, np.bool_),
    bounces=np.empty(0, np.int32),
)


def ways_of(origins: Float64Array, directions: Float64Array, t_min: float, t_max: float) -> tuple[Ways, Float64Array]:
    """The rays as they leave the sensor, and (R,) how far each may go, in world units."""
    count = len(directions)
    ways = Ways(
        rows=np.arange(count, dtype=np.int64),
        origins=origins,
        directions=directions,
        lows=np.full(count, t_min, np.float32),
        highs=np.full(count, t_max, np.float64),
        before=np.zeros(count),
        indices=np.ones(count),
        shares=np.ones(count),
        are_straight=np.ones(count, np.bool_),
    )
    return ways, t_max * length_of(directions)


def follow_light(cast: Cast, ways: Ways) -> Iterator[Arrivals]:
    """Yields the hits of the rays, bounce after bounce."""
    for bounce in range(cast.optics.bounces + 1):
        hits = _cast_rays(cast, ways, is_first=bounce == 0)
        rows = np.flatnonzero(hits.is_hit)
        if not len(rows):
            return
        hits = _part_of(hits, rows)
        surfaces = cast.surfaces.read(hits)
        directions, shares = ways.directions.take(rows, axis=0), ways.shares[rows]
        ahead = unit(directions)
        normals = unit(hits.geometric_normals.astype(np.float64))
        along = dot(ahead, normals)
        ranges = ways.before[rows] + ways.indices[rows] * hits.distances
        returned = surfaces.returned(np.minimum(np.abs(along), 1.0))
        yield Arrivals(
            rows=ways.rows[rows],
            ranges=ranges,
            energies=_that_count(shares * returned),
            positions=hits.positions,
            normals=hits.geometric_normals,
            directions=directions,
            **{name: getattr(hits, name) for name in ("instance_ids", "mesh_ids", "primitive_ids")},
            are_straight=ways.are_straight[rows],
            bounces=np.full(len(rows), bounce, np.int32),
        )
        if bounce < cast.optics.bounces:
            on = surfaces.going_on(cast.optics.mirror_roughness)
            met = _Met(cast, ways.part(rows[on]), _part_of(hits, on), ahead[on], normals[on], along[on], ranges[on])
            ways = _joined([way for way in met.go_on(surfaces.part(on)) if len(way)])
            if not len(ways):
                return


def _cast_rays(cast: Cast, ways: Ways, is_first: bool) -> Hits:
    times = cast.times[ways.rows]
    hits = cast.snapshot.cast_rays(
        ways.origins,
        ways.directions,
        t_min=ways.lows,
        t_max=ways.highs.astype(np.float32),
        mask=cast.mask,
        times=times,
        fields=FIELDS,
        threads=cast.threads,
    )
    if is_first and cast.eyes is not None:
        drop_hidden(hits, cast.eyes[ways.rows], cast.snapshot, cast.mask, times, cast.threads)
    return hits


@dataclass(frozen=True, slots=True)
class _Met:
    """Hits on surfaces that may pass light on, and how they do."""

    cast: Cast
    ways: Ways
    hits: Hits
    ahead: Float64Array
    normals: Float64Array
    along: Float64Array
    ranges: Float64Array

    @property
    def cosines(self) -> Float64Array:
        """(N,) of the angles between rays and normals, for hits on either side."""
        return np.minimum(np.abs(self.along), 1.0)

    def go_on(self, surfaces: Surfaces) -> Iterator[Ways]:
        limit, refracts = self.cast.optics.mirror_roughness, self.cast.optics.refract
        ratios = surfaces.ior
        if refracts:
            ratios = np.where(self.along < 0.0, surfaces.ior, 1.0 / surfaces.ior)
            yield self._straight(1.0 - surfaces.alpha)
            yield self._bent(surfaces.refracted(self.cosines, ratios, limit), ratios)
        else:
            yield self._straight(surfaces.passed(self.cosines, limit))
        yield self._mirrored(surfaces.mirrored(self.cosines, ratios, limit))

    def _straight(self, passed: Float64Array) -> Ways:
        """Continues on the same line, behind the hit surface: beyond its t, so that it cannot be hit again."""
        rows, shares = self._that_count(passed)
        lows = np.nextafter(self.hits.t_hit[rows], np.float32(np.inf))
        return replace(self.ways.part(rows), lows=lows, shares=shares)

    def _mirrored(self, passed: Float64Array) -> Ways:
        rows, shares = self._that_count(passed)
        normals = self.normals[rows]
        directions = self.ahead[rows] - (2.0 * self.along[rows])[:, None] * normals
        return self._leaving(rows, shares, directions, self.ways.indices[rows])

    def _bent(self, passed: Float64Array, ratios: Float64Array) -> Ways:
        """Refracts by Snell's law. Behind the surface, entering light has the speed of the medium, else that of air."""
        rows, shares = self._that_count(passed)
        ratio, cosines, along = 1.0 / ratios[rows], self.cosines[rows], self.along[rows]
        inner = np.sqrt(np.maximum(1.0 - ratio * ratio * (1.0 - cosines * cosines), 0.0))
        facing = np.where(along < 0.0, 1.0, -1.0)[:, None] * self.normals[rows]
        directions = ratio[:, None] * self.ahead[rows] + (ratio * cosines - inner)[:, None] * facing
        return self._leaving(rows, shares, directions, np.where(along < 0.0, ratios[rows], 1.0))

    def _leaving(
        self, rows: npt.NDArray[np.int64], shares: Float64Array, directions: Float64Array, indices: Float64Array
    ) -> Ways:
        """Continues from the hits on another line."""
        ways, origins, before = self.ways.part(rows), self.hits.positions[rows], self.ranges[rows]
        scale = np.maximum(np.abs(origins).max(axis=1, initial=0.0), before)
        return replace(
            ways,
            origins=origins,
            directions=directions,
            lows=(STEP_OFF * scale).astype(np.float32),
            highs=(self.cast.farthest[ways.rows] - before) / indices,
            before=before,
            indices=indices,
            shares=shares,
            are_straight=np.zeros(len(rows), np.bool_),
        )

    def _that_count(self, passed: Float64Array) -> tuple[npt.NDArray[np.int64], Float64Array]:
        """Returns the rows of rays that continue, and their shares of the light: it passes here twice."""
        shares = self.ways.shares * passed * passed
        rows = np.flatnonzero((shares >= LEAST_SHARE) & (self.ranges < self.cast.farthest[self.ways.rows]))
        return rows, shares[rows]


def _that_count(energies: Float64Array) -> Float64Array:
    return np.where(energies >= LEAST_SHARE, energies, 0.0)


def _part_of(hits: Hits, rows: npt.NDArray[np.int64]) -> Hits:
    return replace(hits, columns={name: column.take(rows, axis=0) for name, column in hits.columns.items()})


def _joined(ways: list[Ways]) -> Ways:
    if len(ways) == 1:
        return ways[0]
    if not ways:
        empty, _ = ways_of(np.empty((0, 3)), np.empty((0, 3)), 0.0, 1.0)
        return empty
    return Ways(**{field.name: np.concatenate([getattr(way, field.name) for way in ways]) for field in fields(Ways)})
