"""Cameras and shutters as the native module takes them."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from .camera import Camera
from .shutter import Shutter


def camera_arguments(function: str, camera: object) -> dict[str, Any]:
    """A camera's fields; they were checked when it was made."""
    if not isinstance(camera, Camera):
        raise ValueError(f"{function}: camera must be a perfect_bvh.Camera, got {type(camera).__name__}")
    return {
        "matrix": camera.matrix,
        "window": tuple(map(float, camera.window)),
        "projection": camera.projection,
        "clip_start": float(camera.clip_start),
        "clip_end": float(camera.clip_end),
        "border": tuple(map(float, camera.border)),
        "lens": None if camera.lens is None else asdict(camera.lens),
    }


def shutter_arguments(function: str, projection: str, shutter: object) -> dict[str, Any] | None:
    """A shutter's fields; they were checked when it was made."""
    if shutter is None:
        return None
    if not isinstance(shutter, Shutter):
        raise ValueError(f"{function}: shutter must be a perfect_bvh.Shutter, got {type(shutter).__name__}")
    for moved in shutter.cameras:
        if moved.projection != projection:
            raise ValueError(
                f"{function}: shutter.cameras must be {projection} like the camera, got {moved.projection}"
            )
    return {
        "times": shutter.times(),
        "rolling": shutter.rolling,
        "frame_time": shutter.frame_time,
        "blurs": bool(shutter.blurs),
        "cameras": [camera_arguments(function, moved) for moved in shutter.cameras],
    }
