"""What surfaces look like, as plain arrays: the renderer's only knowledge of colour.

Geometry is in the `Scene`; this is everything that a shading mode may need besides. All of it is optional:
a mode that lacks something falls back to a grey material and the geometric normal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Int32Array = npt.NDArray[np.int32]
Float32Array = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class MeshAppearance:
    """Per-triangle attributes of one mesh of T triangles, in the order of its triangles.

    material_slots: (T,) int32, the slot of the instance's object that each triangle uses. None: all slot 0.
    corner_normals: (T, 3, 3) float32, object space. None: flat shading.
    corner_uvs: (T, 3, 2) float32. None: no uv map.
    """

    material_slots: Int32Array | None = None
    corner_normals: Float32Array | None = None
    corner_uvs: Float32Array | None = None


@dataclass(frozen=True, slots=True)
class MaterialTable:
    """M materials. colors: (M, 4) float32, scene-linear viewport colour. indices: (M,) int32, pass index."""

    colors: Float32Array = field(default_factory=lambda: np.empty((0, 4), np.float32))
    indices: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))


@dataclass(frozen=True, slots=True)
class InstanceTable:
    """I instances, one row each, in any order; instances that are not listed have no materials.

    ids: (I,) int32, the scene's instance ids.
    slot_offsets: (I + 1,) int32: instance i's materials are slot_materials[slot_offsets[i]:slot_offsets[i + 1]].
        Triangles that use a slot beyond these are shown in the last one.
    slot_materials: (S,) int32, rows of the material table, -1 for an empty slot.
    object_indices: (I,) int32, the object's pass index.
    holdout: (I,) bool: the instance cuts a transparent hole into the image.
    """

    ids: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    slot_offsets: Int32Array = field(default_factory=lambda: np.zeros(1, np.int32))
    slot_materials: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    object_indices: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    holdout: npt.NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, np.bool_))


@dataclass(frozen=True, slots=True)
class Appearance:
    """Materials, attributes and visibility of a scene's meshes (by mesh id) and instances.

    camera_mask: the bits of an instance's mask that camera rays see. shadow_mask: those that
    ambient-occlusion and shadow rays see.
    film_transparent: the background has alpha 0 instead of showing the sky.
    """

    meshes: Mapping[int, MeshAppearance] = field(default_factory=dict)
    instances: InstanceTable = field(default_factory=InstanceTable)
    materials: MaterialTable = field(default_factory=MaterialTable)
    camera_mask: int = 0xFFFFFFFF
    shadow_mask: int = 0xFFFFFFFF
    film_transparent: bool = False
