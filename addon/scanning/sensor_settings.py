"""The sensor that the Scan panel's settings describe. Raises ValueError for invalid settings."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from .patterns import CameraGrid, SpinningLidar
from .sensor_files import Sensor, load_sensor

MOST_LINES = 4096  # of a LiDAR: a limit that an extra digit exceeds, so a typing error costs no minutes and no memory


def sensor_of(settings: bpy.types.PropertyGroup) -> Sensor:
    """Returns the sensor of the panel's numbers, of a known name, or of a file."""
    if settings.pattern == "CAMERA":
        return Sensor("camera", "", "", CameraGrid(settings.width, settings.height))
    if settings.pattern == "LIDAR":
        lidar = SpinningLidar(
            elevations=parse_elevations(settings.elevations),
            columns=settings.columns,
            rate=settings.rate,
            max_distance=settings.max_distance,
        )
        return Sensor("lidar", "", "", lidar)
    if settings.pattern != "FILE":
        return load_sensor(settings.pattern)
    if not settings.sensor_file.strip():
        raise ValueError("Choose a sensor's file, or another sensor")
    path = absolute(settings.sensor_file)
    if path.suffix.lower() != ".toml":
        raise ValueError(f"A sensor's file ends in .toml, got {path.name!r}")
    try:
        return load_sensor(path)
    except OSError as problem:
        raise ValueError(f"Cannot read {path}: {problem.strerror or problem}") from problem


def parse_elevations(text: str) -> tuple[float, ...]:
    """Degrees from "-30.67, -29.33, ..." or from "lowest:highest:count"."""
    try:
        if ":" in text:
            lowest, highest, count = text.split(":")
            if int(count) > MOST_LINES:
                raise ValueError(f"{count} lines")
            return tuple(float(angle) for angle in np.linspace(float(lowest), float(highest), int(count)))
        return tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError as problem:
        raise ValueError(
            f"Elevations must be degrees with commas between, or lowest:highest:count with a count of at most "
            f"{MOST_LINES:,}, got {text!r}"
        ) from problem


def absolute(path: str) -> Path:
    """Converts one of Blender's paths to an absolute one."""
    if path.startswith("//") and not bpy.data.filepath:
        raise ValueError(f"{path!r} is relative to the .blend file: save that first")
    return Path(bpy.path.abspath(path))
