"""Per-triangle attributes of an evaluated mesh: material slots and corner normals.

Each is expanded to one row a triangle, so that shading needs no polygons, corners or domains.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from perfect_bvh.bulk import are_triangles

from ...sync.records import Float32Array, Int32Array
from ..pointer_views import CORNER_NORMALS, FACE_INTEGERS, ArrayReader

_zeros = np.zeros(0, np.int32)


def read_material_slots(
    mesh: Any, polygon_ids: Int32Array, reader: ArrayReader, last: Int32Array | None = None
) -> Int32Array:
    """(T,) int32: the material slot of each triangle. Zero where the mesh has no slots; never negative.

    last: what was read the last time, which stands for equal ones.
    """
    attribute = mesh.attributes.get("material_index")
    if attribute is None or attribute.domain != "FACE" or attribute.data_type != "INT":
        return _no_slots(len(polygon_ids))
    face_slots = reader.view(attribute.data, FACE_INTEGERS)
    if last is not None and are_triangles(face_slots, polygon_ids, last):
        return last
    slots: Int32Array = np.take(face_slots, polygon_ids, mode="clip")
    return np.maximum(slots, 0, out=slots)


def _no_slots(count: int) -> Int32Array:
    """Zeros, in memory that all meshes without slots share: to compare two of them takes no time."""
    global _zeros
    if len(_zeros) < count:
        _zeros = np.zeros(count, np.int32)
        _zeros.flags.writeable = False
    return _zeros[:count]


def read_corner_normals(mesh: Any, corner_triangles: Int32Array, reader: ArrayReader) -> Float32Array | None:
    """(T, 3, 3) float32, object space: smooth and custom normals at each triangle's corners.

    None if every face is flat: then the triangle's own normal is the right one, as in Cycles.
    """
    if mesh.normals_domain == "FACE":
        return None
    normals = reader.view(mesh.corner_normals, CORNER_NORMALS)
    # Blender's own indices need no check of their range, and one number of all arrays is sooner had than one a row.
    gathered: Float32Array = np.take(normals, corner_triangles, axis=0, mode="clip")
    # Custom normals can be garbage in a damaged file; a zero normal means "use the triangle's own".
    if not np.isfinite(gathered).all():
        gathered[~np.isfinite(gathered).all(axis=2)] = 0.0
    return gathered
