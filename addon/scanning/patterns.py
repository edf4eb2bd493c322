"""The rays of a sensor, in its own space and time. Does not depend on Blender or on a scene.

A pattern makes the rays of a time interval, independent of the sensor's motion: a camera exposes once in it, a LiDAR
continues to spin from one interval to the next.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt
from perfect_bvh._checks import check_count, check_number

Float64Array = npt.NDArray[np.float64]

# At once, with some 100 bytes each: more fill the memory of usual machines, and the system ends Blender.
MOST_RAYS = 1 << 25


@dataclass(frozen=True, slots=True)
class Rays:
    """R rays in the sensor's space: it looks along -Z with +Y up, as a camera does.

    Attributes:
        origins, directions: (R, 3) float64; directions need not be unit vectors.
        times: (R,) float64, seconds since the scan began.
        ring_ids: (R,) int32, the line of a LiDAR or the row of a picture, from 0.
        t_min, t_max: The range, in multiples of the directions' lengths.
        gap, spread: Neighbouring rays are `gap + spread * distance` apart.
    """

    origins: Float64Array
    directions: Float64Array
    times: Float64Array
    ring_ids: npt.NDArray[np.int32]
    t_min: float
    t_max: float
    gap: float
    spread: float

    def __len__(self) -> int:
        return len(self.directions)

    def part(self, rows: slice) -> Rays:
        """Some of them."""
        columns = ("origins", "directions", "times", "ring_ids")
        return replace(self, **{name: getattr(self, name)[rows] for name in columns})


@dataclass(frozen=True, slots=True)
class View:
    """The camera settings that a camera grid needs; the fields of `perfect_bvh.Camera` of the same names."""

    window: tuple[float, float, float, float]
    projection: str
    clip_start: float
    clip_end: float


class Pattern(Protocol):
    """Makes the rays of `scan`."""

    @property
    def needs_camera(self) -> bool:
        """Whether only a camera will do as the sensor."""

    @property
    def size(self) -> tuple[int, int] | None:
        """(width, height) of the picture that the camera's view is fitted to, None where there is no picture."""

    @property
    def duration(self) -> float:
        """The seconds of one whole sweep: the duration of a scan of a single frame."""

    @property
    def baseline(self) -> float:
        """How far to the right a second eye is that has to see each point as well; 0 for none."""

    def count(self, start: float, end: float) -> int:
        """How many rays are cast in the seconds from `start` to before `end` of the scan."""

    def cast(self, start: float, end: float, view: View | None) -> Rays:
        """Those rays."""


class OnAnyObject:
    """The common part of patterns that need no camera, nor a second eye."""

    __slots__ = ()
    min_distance: float
    max_distance: float

    @property
    def needs_camera(self) -> bool:
        return False

    @property
    def size(self) -> tuple[int, int] | None:
        return None

    @property
    def baseline(self) -> float:
        return 0.0

    def _rays(
        self, directions: Float64Array, times: Float64Array, ring_ids: npt.NDArray[np.int32], spread: float
    ) -> Rays:
        """Rays that start at the sensor, within its range."""
        nowhere = np.zeros_like(directions)
        return Rays(nowhere, directions, times, ring_ids, self.min_distance, self.max_distance, 0.0, spread)


@dataclass(frozen=True, slots=True)
class CameraGrid:
    """One ray through the centre of each pixel of a camera's picture, row after row from the top; all at one time.

    Attributes:
        width, height: Of the picture in pixels. Rays begin and end where the camera clips.
    """

    width: int = 640
    height: int = 360

    def __post_init__(self) -> None:
        check_count("CameraGrid", "width", self.width, 1)
        check_count("CameraGrid", "height", self.height, 1)
        check_ray_count("CameraGrid", "width * height", self.width * self.height)

    @property
    def needs_camera(self) -> bool:
        return True

    @property
    def size(self) -> tuple[int, int] | None:
        return self.width, self.height

    @property
    def duration(self) -> float:
        return 0.0

    @property
    def baseline(self) -> float:
        return 0.0

    def count(self, start: float, end: float) -> int:
        return self.width * self.height

    def cast(self, start: float, end: float, view: View | None) -> Rays:
        assert view is not None
        left, right, bottom, top = view.window
        x = left + (np.arange(self.width) + 0.5) * ((right - left) / self.width)
        y = top - (np.arange(self.height) + 0.5) * ((top - bottom) / self.height)
        plane = np.zeros((self.height, self.width, 3))
        plane[..., 0], plane[..., 1] = x, y[:, None]
        plane = plane.reshape(-1, 3)
        nowhere, forward = np.zeros_like(plane), np.zeros_like(plane)
        forward[:, 2] = -1.0
        origins, directions = {
            "perspective": (nowhere, plane + forward),
            "orthographic": (plane, forward),
            "equirectangular": (nowhere, directions_of(-plane[:, 0], plane[:, 1])),
        }[view.projection]
        apart = abs(right - left) / self.width
        is_parallel = view.projection == "orthographic"
        return Rays(
            origins=origins,
            directions=directions,
            times=np.full(len(plane), start),
            ring_ids=np.repeat(np.arange(self.height, dtype=np.int32), self.width),
            t_min=view.clip_start,
            t_max=view.clip_end,
            gap=apart if is_parallel else 0.0,
            spread=0.0 if is_parallel else apart,
        )


@dataclass(frozen=True, slots=True)
class SpinningLidar(OnAnyObject):
    """A head of several lines, one above the other, that turns to the left about the sensor's upward axis.

    The rays of a column are cast at once, the lines in the order of `elevations`; the next column follows
    1 / (columns * rate) seconds later.

    Attributes:
        elevations: Degrees above the horizon of each line, as the data sheet lists them.
        columns: Shots of each line in one turn.
        rate: Turns per second.
        sweep: Degrees that a turn covers. The sensor looks along the middle.
        min_distance, max_distance: Range of the measured distances, in world units.
    """

    elevations: tuple[float, ...] = tuple(float(angle) for angle in np.linspace(-15.0, 15.0, 16))
    columns: int = 1800
    rate: float = 10.0
    sweep: float = 360.0
    min_distance: float = 0.0
    max_distance: float = math.inf

    def __post_init__(self) -> None:
        if not self.elevations or not all(-90.0 <= angle <= 90.0 for angle in self.elevations):
            raise ValueError(
                f"SpinningLidar: elevations must be degrees from -90 to 90, at least one, got {self.elevations}"
            )
        check_count("SpinningLidar", "columns", self.columns, 1)
        check_ray_count("SpinningLidar", "elevations * columns", len(self.elevations) * self.columns)
        check_number("SpinningLidar", "rate, in turns a second,", self.rate, 0.0, above=True)
        check_number("SpinningLidar", "sweep, in degrees,", self.sweep, 0.0, 360.0, above=True)
        check_range("SpinningLidar", self.min_distance, self.max_distance)

    @property
    def duration(self) -> float:
        return 1.0 / self.rate

    def count(self, start: float, end: float) -> int:
        return len(self._columns_of(start, end)) * len(self.elevations)

    def _columns_of(self, start: float, end: float) -> range:
        a_second = self.columns * self.rate
        # Rounded, so that stretches that meet neither share a column nor lose one.
        return range(first_shot(start * a_second), first_shot(end * a_second))

    def cast(self, start: float, end: float, view: View | None) -> Rays:
        a_second = self.columns * self.rate
        columns = np.array(self._columns_of(start, end), np.int64)
        azimuths = np.radians(((columns % self.columns + 0.5) / self.columns - 0.5) * self.sweep)
        elevations = np.radians(np.array(self.elevations))
        directions = directions_of(np.repeat(azimuths, len(elevations)), np.tile(elevations, len(columns)))
        rings = np.tile(np.arange(len(elevations), dtype=np.int32), len(columns))
        times = np.repeat(columns / a_second, len(elevations))
        return self._rays(directions, times, rings, math.radians(self.sweep) / self.columns)


def directions_of(azimuths: Float64Array, elevations: Float64Array) -> Float64Array:
    """(R, 3) unit vectors from (R,) angles in radians: to the left of forward, and above the horizon."""
    flat = np.cos(elevations)
    return np.stack([-np.sin(azimuths) * flat, np.sin(elevations), -np.cos(azimuths) * flat], axis=1)


def first_shot(place: float) -> int:
    """Returns the number of the first shot at or after a position, with a tolerance for rounding."""
    return math.ceil(place - 1e-6)


def check_range(pattern: str, nearest: float, farthest: float) -> None:
    """Raises ValueError for distances between which nothing can be measured."""
    if not 0.0 <= nearest < farthest:
        raise ValueError(
            f"{pattern}: min_distance must be at least 0 and below max_distance, got {nearest} and {farthest}"
        )


def check_ray_count(pattern: str, name: str, count: int) -> None:
    """Raises ValueError for more rays than fit into memory at once."""
    if count > MOST_RAYS:
        raise ValueError(f"{pattern}: {name} must be at most {MOST_RAYS:,} rays, got {count:,}: scan in parts")
