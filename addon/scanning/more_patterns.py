"""Patterns of sensors that do not spin: rosettes of two prisms, rasters, and depth cameras. No Blender needed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from perfect_bvh._checks import check_count, check_number

from .patterns import Float64Array, OnAnyObject, Rays, View, check_range, check_ray_count, directions_of, first_shot


@dataclass(frozen=True, slots=True)
class Rosette(OnAnyObject):
    """A beam that two turning prisms bend, so that it draws a rosette, closer and closer the longer it looks.

    Attributes:
        field_of_view: Diameter of the circle that is filled, in degrees.
        turns: Turns per second of each prism. Opposite signs are opposite directions.
        rate: Shots per second.
        duration: Seconds of a pass. A scan of one frame covers one.
        min_distance, max_distance: Range of the measured distances, in world units.
    """

    field_of_view: float = 38.4
    turns: tuple[float, float] = (121.6, -77.7)
    rate: float = 100_000.0
    duration: float = 0.1
    min_distance: float = 0.0
    max_distance: float = math.inf

    def __post_init__(self) -> None:
        check_number("Rosette", "field_of_view, in degrees,", self.field_of_view, 0.0, 180.0, above=True, below=True)
        if len(self.turns) != 2 or not all(map(math.isfinite, self.turns)):
            raise ValueError(f"Rosette: turns must be two numbers of turns a second, got {self.turns}")
        check_number("Rosette", "rate, in cycles per second,", self.rate, 0.0, above=True)
        check_number("Rosette", "duration, in seconds,", self.duration, 0.0, above=True)
        check_range("Rosette", self.min_distance, self.max_distance)

    def count(self, start: float, end: float) -> int:
        return len(self._shots(start, end))

    def _shots(self, start: float, end: float) -> range:
        return range(first_shot(start * self.rate), first_shot(end * self.rate))

    def cast(self, start: float, end: float, view: View | None) -> Rays:
        times = np.array(self._shots(start, end), np.float64) / self.rate
        # Each prism bends by half of the largest angle; thin ones add up (Wojtanowski et al. 2014).
        angles = 2.0 * math.pi * times[:, None] * np.array(self.turns)
        bend = math.radians(self.field_of_view) / 4.0
        across, up = bend * np.cos(angles).sum(axis=1), bend * np.sin(angles).sum(axis=1)
        off_axis = np.hypot(across, up)
        share = np.sinc(off_axis / math.pi)  # sin(x) / x
        directions = np.stack([across * share, up * share, -np.cos(off_axis)], axis=1)
        spread = math.radians(self.field_of_view) / math.sqrt(max(self.rate * self.duration, 1.0))
        return self._rays(directions, times, np.zeros(len(times), np.int32), spread)


@dataclass(frozen=True, slots=True)
class Raster(OnAnyObject):
    """A solid-state sensor that looks along one row of its field after another, from the left above to the right below.

    Attributes:
        width, height: Number of shots in a row, and of rows.
        horizontal, vertical: Field of view, in degrees.
        rate: Pictures per second. Shots are evenly spaced in time.
        min_distance, max_distance: Range of the measured distances, in world units.
    """

    width: int = 1150
    height: int = 250
    horizontal: float = 115.0
    vertical: float = 25.0
    rate: float = 10.0
    min_distance: float = 0.0
    max_distance: float = math.inf

    def __post_init__(self) -> None:
        _check_grid("Raster", self.width, self.height)
        _check_field("Raster", self.horizontal, self.vertical, (360.0, 180.0))
        check_number("Raster", "rate, in cycles per second,", self.rate, 0.0, above=True)
        check_range("Raster", self.min_distance, self.max_distance)

    @property
    def duration(self) -> float:
        return 1.0 / self.rate

    def count(self, start: float, end: float) -> int:
        return len(self._shots(start, end))

    def _shots(self, start: float, end: float) -> range:
        a_second = self.width * self.height * self.rate
        return range(first_shot(start * a_second), first_shot(end * a_second))

    def cast(self, start: float, end: float, view: View | None) -> Rays:
        shots = np.array(self._shots(start, end), np.int64)
        rows, columns = np.divmod(shots % (self.width * self.height), self.width)
        azimuths = math.radians(self.horizontal) * (0.5 - (columns + 0.5) / self.width)
        elevations = math.radians(self.vertical) * (0.5 - (rows + 0.5) / self.height)
        directions = directions_of(azimuths, elevations)
        times = shots / (self.width * self.height * self.rate)
        return self._rays(directions, times, rows.astype(np.int32), math.radians(self.horizontal) / self.width)


@dataclass(frozen=True, slots=True)
class DepthCamera(OnAnyObject):
    """A camera that measures the depth of each pixel, all at once; it may be on any object, and has its own lens.

    Attributes:
        width, height: Size of the picture, in pixels.
        horizontal, vertical: Field of view, in degrees.
        rate: Pictures per second.
        min_distance, max_distance: Range of the measured depths along the camera's axis, in world units.
        baseline: Distance to the second camera or the projector on the right, which must see a point as well, in world
            units. 0 for none, as in a time-of-flight camera.
    """

    width: int = 640
    height: int = 576
    horizontal: float = 75.0
    vertical: float = 65.0
    rate: float = 30.0
    min_distance: float = 0.0
    max_distance: float = math.inf
    baseline: float = 0.0

    def __post_init__(self) -> None:
        _check_grid("DepthCamera", self.width, self.height)
        _check_field("DepthCamera", self.horizontal, self.vertical, (170.0, 170.0))
        check_number("DepthCamera", "rate, in cycles per second,", self.rate, 0.0, above=True)
        check_range("DepthCamera", self.min_distance, self.max_distance)
        check_number("DepthCamera", "baseline", self.baseline)

    @property
    def duration(self) -> float:
        return 1.0 / self.rate

    def count(self, start: float, end: float) -> int:
        return len(self._pictures(start, end)) * self.width * self.height

    def _pictures(self, start: float, end: float) -> range:
        return range(first_shot(start * self.rate), first_shot(end * self.rate))

    def cast(self, start: float, end: float, view: View | None) -> Rays:
        pictures = np.array(self._pictures(start, end), np.float64) / self.rate
        across, up = (math.tan(math.radians(angle) / 2.0) for angle in (self.horizontal, self.vertical))
        x = across * (2.0 * (np.arange(self.width) + 0.5) / self.width - 1.0)
        y = up * (1.0 - 2.0 * (np.arange(self.height) + 0.5) / self.height)
        grid: Float64Array = np.full((self.height, self.width, 3), -1.0)
        grid[..., 0], grid[..., 1] = x, y[:, None]
        directions = np.tile(grid.reshape(-1, 3), (len(pictures), 1))
        rows = np.repeat(np.arange(self.height, dtype=np.int32), self.width)
        times = np.repeat(pictures, self.width * self.height)
        return self._rays(directions, times, np.tile(rows, len(pictures)), 2.0 * across / self.width)


def _check_grid(pattern: str, width: int, height: int) -> None:
    check_count(pattern, "width", width, 1)
    check_count(pattern, "height", height, 1)
    check_ray_count(pattern, "width * height", width * height)


def _check_field(pattern: str, horizontal: float, vertical: float, most: tuple[float, float]) -> None:
    for name, angle, limit in (("horizontal", horizontal, most[0]), ("vertical", vertical, most[1])):
        check_number(pattern, f"{name}, in degrees,", angle, 0.0, limit, above=True)
