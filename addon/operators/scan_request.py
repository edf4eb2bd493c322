"""What the Scan panel asks for, read from its settings. All raise ValueError with what is wrong with them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..settings.point_color_items import OTHER
from ..settings.scan_settings import label_names

if TYPE_CHECKING:
    from ..scanning import Sensor
    from ..scanning.piece_scan import ScanPlan

MOST_LINES = 4096  # of a LiDAR: so many that a digit too much costs no minutes and no memory


def sensor_of(settings: bpy.types.PropertyGroup) -> Sensor:
    """Of the numbers in the panel, of a known name, or of a file."""
    from ..scanning import CameraGrid, Sensor, SpinningLidar, load_sensor

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


def frames_of(scene: bpy.types.Scene) -> tuple[int, int] | None:
    """The first and the last one; None for the current one alone."""
    settings = scene.perfect_bvh.scan
    if settings.frames == "CURRENT":
        return None
    if settings.frames == "SCENE":
        return scene.frame_start, scene.frame_end
    if settings.frame_end < settings.frame_start:
        raise ValueError(f"The range must end at or after its start, {settings.frame_start}: got {settings.frame_end}")
    return settings.frame_start, settings.frame_end


def exclude_mount_of(scene: bpy.types.Scene) -> bool | None:
    """As `scan` has it; None to decide by the object."""
    return {"AUTO": None, "EXCLUDE": True, "SCAN": False}[scene.perfect_bvh.scan.mount]


def threads_of(scene: bpy.types.Scene) -> int:
    """As many as renders take."""
    return scene.render.threads if scene.render.threads_mode == "FIXED" else 0


def plan_of(scene: bpy.types.Scene) -> ScanPlan:
    """Of a scan into files."""
    from ..scanning.formats import check_format
    from ..scanning.piece_scan import ScanPlan

    settings, frames = scene.perfect_bvh.scan, frames_of(scene)
    suffix = f".{settings.file_format}"
    try:
        check_format(suffix, label_names(settings))
    except ImportError as problem:
        raise ValueError(f"{settings.file_format}: {problem}") from problem
    return ScanPlan(
        sensor=sensor_of(settings),
        frames=(scene.frame_current,) if frames is None else tuple(range(frames[0], frames[1] + 1)),
        is_one_pass=frames is None,
        suffix=suffix,
        size=settings.frames_per_file,
        steps=settings.steps_per_frame,
        threads=threads_of(scene),
        labels=label_names(settings),
        seed=settings.seed,
        exclude_mount=exclude_mount_of(scene),
        for_viewport=settings.use_viewport,
    )


def folder_of(settings: bpy.types.PropertyGroup) -> Path:
    """Where files go."""
    if not settings.folder.strip():
        raise ValueError("Choose a folder for the files")
    path = absolute(settings.folder)
    if path.exists() and not path.is_dir():
        raise ValueError(f"{path} is a file: choose a folder")
    return path


def absolute(path: str) -> Path:
    """Of a path as Blender has them."""
    if path.startswith("//") and not bpy.data.filepath:
        raise ValueError(f"{path!r} is relative to the .blend file: save that first")
    return Path(bpy.path.abspath(path))


def check_colors(settings: bpy.types.PropertyGroup) -> None:
    """Refuses a column that the points will not have: to know it before the work."""
    from ..scanning.point_cloud import column_names
    from ..scanning.point_data import column_names_of_points

    known = [*column_names_of_points(), *column_names(label_names(settings)).values()]
    if settings.point_color == OTHER and settings.point_column not in known:
        raise ValueError(f"Color: the points have no column {settings.point_column!r}, but {', '.join(known)}")
