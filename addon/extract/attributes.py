"""Per-triangle attributes of an evaluated mesh: material slots, corner normals, corner uvs.

Each is expanded to one row a triangle, so that whoever shades needs no polygons, corners or domains.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..sync.records import Float32Array, Int32Array
from .pointer_views import CORNER_NORMALS, CORNER_UVS, FACE_INTEGERS, ArrayReader


def read_material_slots(mesh: Any, polygon_ids: Int32Array, reader: ArrayReader) -> Int32Array:
    """(T,) int32: the material slot of each triangle. Zero where the mesh has no slots; never negative."""
    attribute = mesh.attributes.get("material_index")
    if attribute is None or attribute.domain != "FACE" or attribute.data_type != "INT":
        return np.zeros(len(polygon_ids), np.int32)
    slots: Int32Array = reader.read(attribute.data, FACE_INTEGERS)[polygon_ids]
    return np.maximum(slots, 0, out=slots)


def read_corner_normals(mesh: Any, corner_triangles: Int32Array, reader: ArrayReader) -> Float32Array | None:
    """(T, 3, 3) float32, object space: smooth and custom normals at each triangle's corners.

    None if every face is flat: then the triangle's own normal is the right one, as in Cycles.
    """
    if mesh.normals_domain == "FACE":
        return None
    normals = reader.read(mesh.corner_normals, CORNER_NORMALS)
    # Custom normals can be garbage in a damaged file; a zero normal means "use the triangle's own".
    finite = np.isfinite(normals).all(axis=1)
    if not finite.all():
        normals[~finite] = 0.0
    gathered: Float32Array = normals[corner_triangles]
    return gathered


def read_corner_uvs(mesh: Any, corner_triangles: Int32Array, reader: ArrayReader) -> Float32Array | None:
    """(T, 3, 2) float32: the uv map that renders use, at each triangle's corners. None if there is none."""
    layers = mesh.uv_layers
    if not layers:
        return None
    layer = next((layer for layer in layers if layer.active_render), layers[0])
    gathered: Float32Array = reader.read(layer.uv, CORNER_UVS)[corner_triangles]
    return gathered
