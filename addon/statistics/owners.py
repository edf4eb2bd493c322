"""Which objects show which meshes in an image: users know their objects, the engine its meshes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..sync.records import Int32Array, ObjectRecord


@dataclass(frozen=True, slots=True, eq=False)
class Owners:
    """A scene's instances, as columns of its record: nothing is copied.

    mesh_ids: (M,) int32, the engine's, by mesh. mesh_rows, object_rows: (I,) int32, of each instance, rows of mesh_ids
    and of objects; parent_rows: of the instancer, -1 for a plain object. shares: (I,), which part of the camera rays'
    work went into those that end on each; None if nothing was traced.
    """

    mesh_ids: Int32Array
    objects: tuple[ObjectRecord, ...]
    mesh_rows: Int32Array
    object_rows: Int32Array
    parent_rows: Int32Array
    shares: npt.NDArray[np.float64] | None = None
