"""How each kind of bake makes rays from points, and values from their answers. Does not depend on Blender.

A tally holds the sums of a block of points, and casts rays step by step. Those of a step begin near each other and lead
much the same way. Rays below the horizon of their own triangle see nothing, and are not cast.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from perfect_bvh import Camera
from perfect_bvh.queries import ALL_MASK, Queries

from ..sync.keys import mix
from ..sync.records import VISIBLE_TO_CAMERA, VISIBLE_TO_DIFFUSE, VISIBLE_TO_SHADOW, Float64Array
from .receivers import Points
from .settings import BakeSettings

_BALL_STEPS = 40  # each makes the sphere smaller; most end after five
_SAME = 1.0 - 1e-6  # a sphere that nothing enters by more than this is the largest


@dataclass(frozen=True, slots=True, eq=False)
class Viewer:
    """A place that may see points. camera: it sees only what is in its frame; None: all around it."""

    position: Float64Array
    camera: Camera | None = None

    def sees(self, positions: Float64Array) -> npt.NDArray[np.bool_]:
        """(P,): which positions are in its frame and between its clip distances."""
        camera = self.camera
        if camera is None:
            return np.ones(len(positions), np.bool_)
        axes = camera.matrix[:3, :3] / np.linalg.norm(camera.matrix[:3, :3], axis=0)
        x, y, z = ((positions - self.position) @ axes).T
        depth = -z
        with np.errstate(divide="ignore", invalid="ignore"):
            if camera.projection == "perspective":
                x, y = x / depth, y / depth
            elif camera.projection == "equirectangular":
                depth, x, y = np.sqrt(x * x + y * y + z * z), np.arctan2(x, -z), np.arctan2(y, np.hypot(x, z))
        left, right, bottom, top = camera.window
        inside = (x >= left) & (x <= right) & (y >= bottom) & (y <= top)
        return inside & (depth >= camera.clip_start) & (depth <= camera.clip_end)


class Tally(ABC):
    """The sums of a block of points.

    Attributes:
        scene, threads: Where rays are cast; set before `cast`. viewers: of the frame.
        step_count: `cast` is called with 0, 1, ... ray_count: The number of rays that were cast.
        mask: The kind of rays, which decides which objects are in their way.
    """

    mask: ClassVar[int] = VISIBLE_TO_DIFFUSE
    scene: Queries
    threads = 0

    def __init__(self, points: Points, settings: BakeSettings, viewers: Sequence[Viewer] = ()) -> None:
        self.points, self.settings, self.viewers = points, settings, viewers
        self.ray_count, self.step_count, self.sums = 0, 1, np.zeros(len(points))
        self.begin()

    @abstractmethod
    def begin(self) -> None:
        """Sets the number of steps, and further sums."""

    @abstractmethod
    def cast(self, step: int) -> None:
        """Casts the rays of a step, and adds what they see."""

    @abstractmethod
    def columns(self) -> dict[str, Float64Array]:
        """Returns (P,) by the names of the kind's columns; with "error", the standard error, for sampled kinds."""

    def blocked(self, rows: Any, directions: Float64Array, reach: float = math.inf) -> npt.NDArray[np.bool_]:
        """Tests which of the rays from some points end within `reach` lengths."""
        return self.scene.test_occlusions(
            *self._rays(rows, directions), t_max=reach, mask=self.mask, threads=self.threads
        )

    def distances(self, directions: Float64Array) -> Float64Array:
        """Returns the length of each point's ray to the next surface; inf for none within the distance."""
        how: dict[str, Any] = {"t_max": self.settings.distance, "mask": self.mask, "threads": self.threads}
        rays = self._rays(np.arange(len(self.points)), directions)
        return self.scene.cast_rays(*rays, fields=("t_hit",), **how).t_hit.astype(np.float64)

    def _rays(self, rows: Any, directions: Float64Array) -> tuple[Float64Array, Float64Array]:
        self.ray_count += len(rows)
        return self.points.positions.take(rows, axis=0), directions


class SunTally(Tally):
    """Sums the weights of the directions of a table from which light arrives.

    Equal weights are counted, so that 72 steps of a sixth of an hour are 12 hours.
    """

    mask = VISIBLE_TO_SHADOW

    def begin(self) -> None:
        table = self.settings.directions
        self.directions, self.weights, self.step_count = table.directions, table.weights, len(table.directions)
        different = np.unique(table.weights)
        self.each = 1.0
        if len(different) == 1 and not self.settings.has_cosine:
            self.each, self.weights = float(different[0]), np.ones(self.step_count)
        width = (self.step_count + 7) // 8 if self.settings.keep_visible else 0
        self.visible = np.zeros((len(self.points), width), np.uint8)

    def cast(self, step: int) -> None:
        heights = self.points.normals @ self.directions[step]
        rows = np.flatnonzero(heights > 0.0)
        rows = rows[~self.blocked(rows, self.directions[step])]
        self.sums[rows] += self.weights[step] * (heights[rows] if self.settings.has_cosine else 1.0)
        if self.settings.keep_visible:
            self.visible[rows, step // 8] |= 0x80 >> (step % 8)

    def columns(self) -> dict[str, Float64Array]:
        return {"sun_hours": self.sums * self.each}


class SampledTally(Tally):
    """Averages rays over a hemisphere, or a cone: two in each cell of a grid that divides it evenly.

    Half the squared difference of the two is on average their variance, so the standard error is that of the grid.
    """

    name: ClassVar[str]
    is_cosine = True
    widest = 1.0  # the sine of the cone's half angle

    def begin(self) -> None:
        count, rays = len(self.points), self.settings.rays
        self.rings = max(1, int(math.sqrt(rays / (2.0 * math.pi))))  # cells are about as wide as high
        self.sectors = math.ceil(rays / (2 * self.rings))
        self.step_count = 2 * self.rings * self.sectors
        self.counts, self.pairs, self.squares = np.zeros(count), np.zeros(count), np.zeros(count)
        z = self.points.normals if self.is_cosine else np.broadcast_to((0.0, 0.0, 1.0), (count, 3))
        sign = np.copysign(1.0, z[:, 2])  # the frame of Duff and others, 2017
        a = -1.0 / (sign + z[:, 2])
        b = z[:, 0] * z[:, 1] * a
        x = np.stack([1.0 + sign * z[:, 0] ** 2 * a, sign * b, -sign * z[:, 0]], axis=1)
        self.axes = x, np.stack([b, sign + z[:, 1] ** 2 * a, -z[:, 1]], axis=1), z

    def rays(self, step: int) -> tuple[Float64Array, Float64Array]:
        """(P, 3) unit directions in a cell, and their cosines to the middle axis."""
        ring, sector = divmod(step // 2, self.sectors)
        stream = mix(np.array([self.settings.seed << 32 | step], np.uint64))
        bits = mix(mix(self.points.ids) ^ stream)
        u = (ring + (bits >> np.uint64(32)) * 2.0**-32) * (self.widest**2 / self.rings)
        turn = (sector + (bits & np.uint64(0xFFFFFFFF)) * 2.0**-32) * (2.0 * math.pi / self.sectors)
        cosine = np.sqrt(1.0 - u) if self.is_cosine else 1.0 - u
        sine = np.sqrt(1.0 - cosine * cosine)
        x, y, z = self.axes
        flat = (sine * np.cos(turn))[:, None] * x + (sine * np.sin(turn))[:, None] * y
        return flat + cosine[:, None] * z, cosine

    def cast(self, step: int) -> None:
        values = self.see(*self.rays(step))
        is_known = ~np.isnan(values)
        self.sums[is_known] += values[is_known]
        self.counts += is_known
        if step % 2:
            difference = values - self.last
            is_pair = ~np.isnan(difference)
            self.squares[is_pair] += difference[is_pair] ** 2
            self.pairs += is_pair
        self.last = values

    @abstractmethod
    def see(self, directions: Float64Array, cosines: Float64Array) -> Float64Array:
        """Casts a ray from each point; returns their values, NaN for a ray without one."""

    def columns(self) -> dict[str, Float64Array]:
        with np.errstate(invalid="ignore", divide="ignore"):
            return {self.name: self.sums / self.counts, "error": np.sqrt(self.squares) / (2.0 * self.pairs)}


class SkyTally(SampledTally):
    """The share of the sky that is seen: weighted by the cosine, or by solid angle alone."""

    name = "sky_view"

    def begin(self) -> None:
        self.is_cosine = self.settings.has_cosine
        super().begin()

    def see(self, directions: Float64Array, cosines: Float64Array) -> Float64Array:
        heights = directions[:, 2] if self.is_cosine else (directions * self.points.normals).sum(axis=1)
        rows = np.flatnonzero(heights > 0.0)
        values = np.zeros(len(self.points))
        values[rows] = ~self.blocked(rows, directions.take(rows, axis=0))
        return values


class OcclusionTally(SampledTally):
    """How open a point is: 1 where nothing is within the distance."""

    name = "ambient_occlusion"

    def see(self, directions: Float64Array, cosines: Float64Array) -> Float64Array:
        reach, falloff = self.settings.distance, self.settings.falloff
        if falloff == 0.0:
            return 1.0 - self.blocked(np.arange(len(self.points)), directions, reach)
        return np.asarray(1.0 - np.maximum(1.0 - self.distances(directions) / reach, 0.0) ** falloff)


class ConeTally(SampledTally):
    """The mean distance to the opposite surface along the normal, over a cone around it, weighted by the cosine."""

    name = "thickness"
    mask = ALL_MASK

    def begin(self) -> None:
        self.widest = math.sin(self.settings.angle)
        super().begin()
        if self.settings.angle == 0.0:
            self.step_count = 2  # all are alike

    def see(self, directions: Float64Array, cosines: Float64Array) -> Float64Array:
        found = self.distances(directions)
        return np.where(np.isinf(found), np.nan, found * cosines)


class SphereTally(Tally):
    """The diameter of the largest sphere inside that touches the surface at the point (Ma, Bae and Choi 2012).

    Each step asks for the surface nearest to the sphere's centre, and makes the sphere smaller until it touches that.
    """

    mask = ALL_MASK

    def begin(self) -> None:
        self.step_count = 1 + _BALL_STEPS

    def cast(self, step: int) -> None:
        if step == 0:
            self.sums = 0.5 * self.distances(self.points.normals)
            self.active = np.flatnonzero(np.isfinite(self.sums))
        elif len(rows := self.active):
            radii, positions, normals = self.sums[rows], self.points.positions[rows], self.points.normals[rows]
            how: dict[str, Any] = {"max_distance": radii * _SAME, "mask": self.mask, "threads": self.threads}
            closest = self.scene.compute_closest_points(positions + normals * radii[:, None], **how)
            self.ray_count += len(rows)
            to = closest.points - positions
            heights = (to * normals).sum(axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):
                smaller = 0.5 * (to * to).sum(axis=1) / heights
            is_smaller = closest.is_found & (heights > 0.0) & (smaller < radii * _SAME)
            self.active = rows[is_smaller]
            self.sums[self.active] = smaller[is_smaller]

    def columns(self) -> dict[str, Float64Array]:
        return {"thickness": np.where(np.isfinite(self.sums), 2.0 * self.sums, np.nan)}


class ExposureTally(Tally):
    """How many viewers see a point, from how near, and at what angle to its normal."""

    mask = VISIBLE_TO_CAMERA

    def begin(self) -> None:
        self.step_count, self.viewer_count = len(self.viewers), 0
        self.nearest, self.cosines = np.full((2, len(self.points)), np.nan)

    def cast(self, step: int) -> None:
        viewer = self.viewers[step]
        to = viewer.position - self.points.positions
        if viewer.camera is not None and viewer.camera.projection == "orthographic":
            axis = viewer.camera.matrix[:3, 2] / np.linalg.norm(viewer.camera.matrix[:3, 2])
            to = (to @ axis)[:, None] * axis
        away, heights = np.linalg.norm(to, axis=1), (to * self.points.normals).sum(axis=1)
        is_near = (heights > 0.0) & (away <= self.settings.distance)
        rows = np.flatnonzero(is_near & viewer.sees(self.points.positions))
        rows = rows[~self.blocked(rows, to[rows], 1.0)]
        self.viewer_count += 1
        self.sums[rows] += 1.0
        self.nearest[rows] = np.fmin(self.nearest[rows], away[rows])
        self.cosines[rows] = np.fmax(self.cosines[rows], heights[rows] / away[rows])

    def columns(self) -> dict[str, Float64Array]:
        share, angles = self.sums / max(self.viewer_count, 1), np.arccos(np.minimum(self.cosines, 1.0))
        return {"exposure": share, "nearest_distance": self.nearest, "smallest_angle": angles}


TALLIES: dict[str, type[Tally]] = {
    "SUN_HOURS": SunTally,
    "SKY_VIEW": SkyTally,
    "AMBIENT_OCCLUSION": OcclusionTally,
    "THICKNESS": ConeTally,
    "EXPOSURE": ExposureTally,
}


def tally_of(settings: BakeSettings) -> type[Tally]:
    """Returns the class of tallies that answers the settings' question."""
    return SphereTally if (settings.kind, settings.method) == ("THICKNESS", "SPHERE") else TALLIES[settings.kind]
