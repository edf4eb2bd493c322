"""Attributes that geometry nodes left on instances, looked up by persistent id (Blender 4.5 and later).

A persistent id has a level for each geometry that an instance stands in, the innermost first. As in Blender, the
innermost geometry that has the attribute counts.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ...sync.records import Float32Array, Int32Array

_UNUSED_LEVEL = 2**31 - 1
_NUMBERS = {"FLOAT": np.float32, "INT": np.int32, "INT8": np.int8, "BOOLEAN": np.bool_}
_VECTORS = {"FLOAT2": 2, "FLOAT_VECTOR": 3}
_COLORS = {"FLOAT_COLOR", "BYTE_COLOR"}

Found = tuple[Float32Array, npt.NDArray[np.bool_]]


def find_instance_attribute(instancer: Any, name: str, persistent_ids: Int32Array) -> Found:
    """(N, 4) colours and (N,) whether there is one, for instances of an evaluated object."""
    count = len(persistent_ids)
    nothing = np.zeros((count, 4), np.float32), np.zeros(count, np.bool_)
    if not hasattr(instancer, "evaluated_geometry") or not any(one.type == "NODES" for one in instancer.modifiers):
        return nothing
    levels = (persistent_ids != _UNUSED_LEVEL).sum(axis=1) - 1
    return _find_in(instancer.evaluated_geometry(), name, persistent_ids, levels)


def _find_in(geometry: Any, name: str, ids: Int32Array, levels: npt.NDArray[np.intp]) -> Found:
    """levels: (N,) which level of each id is this geometry's; below 0 if none is."""
    values, is_found = np.zeros((len(ids), 4), np.float32), np.zeros(len(ids), np.bool_)
    points = geometry.instances_pointcloud()
    count = 0 if points is None else len(points.points)
    if not count or not len(ids):
        return values, is_found
    places = _places(points, ids[np.arange(len(ids)), np.maximum(levels, 0)], count)
    places[levels < 0] = -1
    own = _read_colors(points.attributes.get(name))
    if own is not None:
        is_found = places >= 0
        values[is_found] = own[places[is_found]]
    references = np.empty(count, np.int32)
    points.attributes[".reference_index"].data.foreach_get("value", references)
    kinds = np.where(places >= 0, references[places], -1)
    for number, reference in enumerate(geometry.instance_references()):
        rows = np.flatnonzero(kinds == number)
        shown = _geometry_of(reference) if len(rows) else None
        if shown is not None:
            inner, is_within = _find_in(shown, name, ids[rows], levels[rows] - 1)
            values[rows[is_within]], is_found[rows[is_within]] = inner[is_within], True
    return values, is_found


def _geometry_of(reference: Any) -> Any:
    """What instances of a reference show, if it may show instances itself."""
    if isinstance(reference, bpy.types.GeometrySet):
        return reference
    shows = isinstance(reference, bpy.types.Object) and any(one.type == "NODES" for one in reference.modifiers)
    return reference.evaluated_geometry() if shows else None


def _places(points: Any, ids: Int32Array, count: int) -> npt.NDArray[np.intp]:
    """Which point each id is, -1 for none: its number, or the value of the attribute `id`."""
    own = points.attributes.get("id")
    if own is None:
        return np.where((ids >= 0) & (ids < count), ids, -1).astype(np.intp)
    numbers = np.empty(count, np.int32)
    own.data.foreach_get("value", numbers)
    order = np.argsort(numbers, kind="stable")
    nearest = order[np.minimum(np.searchsorted(numbers[order], ids), count - 1)]
    return np.where(numbers[nearest] == ids, nearest, -1)


def _read_colors(attribute: Any) -> Float32Array | None:
    """(N, 4), or None for what is no number, vector or colour."""
    if attribute is None:
        return None
    kind, count = attribute.data_type, len(attribute.data)
    colors = np.ones((count, 4), np.float32)
    if kind in _NUMBERS:
        numbers = np.empty(count, _NUMBERS[kind])
        attribute.data.foreach_get("value", numbers)
        colors[:, :3] = numbers[:, None]
        return colors
    width = _VECTORS.get(kind, 4 if kind in _COLORS else 0)
    if not width:
        return None
    channels = np.empty((count, width), np.float32)
    attribute.data.foreach_get("color" if kind in _COLORS else "vector", channels.reshape(-1))
    colors[:, 2] = 0.0  # of two channels
    colors[:, :width] = channels
    return colors
