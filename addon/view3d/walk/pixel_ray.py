"""The ray through a place of a region, as the picture of that region is traced. Knows no Blender."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...sync.records import CameraRecord

Float64Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PixelRay:
    """origin, direction: (3,), of length one: t is a distance. t_min, t_max: where the view begins and ends.

    has_eye: whether it begins where somebody could stand: rays of orthographic views begin far outside.
    """

    origin: Float64Array
    direction: Float64Array
    t_min: float
    t_max: float
    has_eye: bool


def pixel_ray(camera: CameraRecord, x: float, y: float) -> PixelRay | None:
    """x, y: the place in the region as fractions from its lower left corner. None where nothing is seen."""
    left, right, bottom, top = camera.window
    across, up = left + x * (right - left), bottom + y * (top - bottom)
    origin, direction = np.zeros(3), np.array([across, up, -1.0])
    if camera.projection == "orthographic":
        origin, direction = np.array([across, up, 0.0]), np.array([0.0, 0.0, -1.0])
    elif camera.projection == "equirectangular":
        west, east, south, north = camera.border
        if not (west <= x <= east and south <= y <= north):
            return None
        direction = np.array([np.sin(across) * np.cos(up), np.sin(up), -np.cos(across) * np.cos(up)])
    length = float(np.linalg.norm(direction))
    turn = camera.matrix[:3, :3]
    return PixelRay(
        origin=turn @ origin + camera.matrix[:3, 3],
        direction=turn @ (direction / length),
        t_min=camera.clip_start * length,  # clipping goes by the view's axis
        t_max=camera.clip_end * length,
        has_eye=camera.projection != "orthographic",
    )
