"""The answers to a batch of points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

# name -> (dtype, values a point)
COLUMN_TYPES: dict[str, tuple[type[np.generic], int]] = {
    "points": (np.float64, 3),
    "distances": (np.float64, 1),
    "instance_ids": (np.int32, 1),
    "mesh_ids": (np.int32, 1),
    "primitive_ids": (np.int32, 1),
    "primitive_uvs": (np.float32, 2),
}


@dataclass(frozen=True, slots=True)
class ClosestPoints:
    """One row a point, in the shape of the points that were given.

    points (..., 3) float64: the nearest point of the scene, world space; zero if none is near enough.
    distances (...) float64: the distance to it, world units; inf if there is none. On a sliver both may be off by up to
        1e-9 of the mesh's extent.
    instance_ids, mesh_ids, primitive_ids (...) int32: the primitive that it lies on; -1 if there is none.
    primitive_uvs (..., 2) float32: the point is (1 - u - v) v0 + u v1 + v v2; zero if there is none. For curves and
        points as in `Hits`.
    invalid_count: points that are not finite, or whose max_distance is negative or NaN.
    generation, scene_id: of the snapshot that answered, see `Snapshot`; ids are valid for that snapshot.
    """

    points: npt.NDArray[np.float64]
    distances: npt.NDArray[np.float64]
    instance_ids: npt.NDArray[np.int32]
    mesh_ids: npt.NDArray[np.int32]
    primitive_ids: npt.NDArray[np.int32]
    primitive_uvs: npt.NDArray[np.float32]
    invalid_count: int
    generation: int
    scene_id: int

    @property
    def is_found(self) -> npt.NDArray[np.bool_]:
        """(...) bool: whether anything was near enough."""
        return np.asarray(self.instance_ids >= 0)


def allocate_closest(shape: tuple[int, ...]) -> dict[str, npt.NDArray[Any]]:
    """Allocates arrays for the answers to points of this shape."""
    return {
        name: np.empty(shape if width == 1 else (*shape, width), dtype) for name, (dtype, width) in COLUMN_TYPES.items()
    }
