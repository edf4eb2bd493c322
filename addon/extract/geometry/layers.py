"""The uv maps and colours that materials name: of meshes a row a triangle, of hair and points one a curve or a point.

A name stands for whatever has it, as in Cycles: a uv map or a colour attribute, or what geometry nodes stored. The uv
map that has no name is of curves the first attribute with two numbers, which is where on the surface they are rooted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ...sync.records import Float32Array, Int32Array, LayerRequest
from ..pointer_views import CORNER_UVS, ArrayReader

# The property and the channels of an element, by the attribute's type.
CHANNELS = {
    "FLOAT": ("value", 1),
    "FLOAT2": ("vector", 2),
    "FLOAT_VECTOR": ("vector", 3),
    "FLOAT_COLOR": ("color", 4),
    "BYTE_COLOR": ("color", 4),
}


@dataclass(frozen=True, slots=True)
class Corners:
    """Where the corners of a mesh's triangles find their values, by an attribute's domain."""

    corner_triangles: Int32Array
    triangles: Int32Array
    polygon_ids: Int32Array

    def rows(self, domain: str) -> npt.NDArray[np.int32] | None:
        """(T, 3), or (T, 1) if a triangle has one value; None for a domain that no corner belongs to."""
        if domain == "CORNER":
            return self.corner_triangles
        if domain == "POINT":
            return self.triangles
        return self.polygon_ids[:, None] if domain == "FACE" else None


@dataclass(frozen=True, slots=True)
class Kept:
    """Which points and curves are shown; None: all."""

    points: npt.NDArray[np.bool_] | None
    curves: Int32Array | None


def read_uv_maps(mesh: Any, request: LayerRequest, corners: Corners, reader: ArrayReader) -> dict[str, Float32Array]:
    """(T, 3, 2) float32 by name, of those maps that the mesh has; "" is the one that is active for renders."""
    layers = mesh.uv_layers
    active = next((layer for layer in layers if layer.active_render), layers[0]) if len(layers) else None
    found: dict[str, Float32Array] = {}
    if "" in request.uvs and active is not None:
        found[""] = _gather(reader.view(active.uv, CORNER_UVS), corners)
    for name in request.uvs - {""}:
        if active is not None and active.name == name and "" in found:
            found[name] = found[""]
        elif name in layers:
            found[name] = _gather(reader.view(layers[name].uv, CORNER_UVS), corners)
        else:
            values = _read_attribute(mesh.attributes.get(name), corners, 2)
            if values is not None:
                found[name] = values
    return found


def _gather(values: Float32Array, corners: Corners) -> Float32Array:
    """Of each triangle's corners; Blender's own indices need no check of their range."""
    return np.take(values, corners.corner_triangles, axis=0, mode="clip")


def read_colors(mesh: Any, request: LayerRequest, corners: Corners) -> dict[str, Float32Array]:
    """(T, 3, 3) float32, scene-linear, by name, of those colours that the mesh has; "" are those active for renders."""
    colors = mesh.color_attributes
    found: dict[str, Float32Array] = {}
    for name in request.colors:
        attribute = mesh.attributes.get(name)
        if not name:
            has_active = 0 <= colors.render_color_index < len(colors)
            attribute = colors[colors.render_color_index] if has_active else None
        values = _read_attribute(attribute, corners, 3)
        if values is not None:
            found[name] = values
    return found


def _read_attribute(attribute: Any, corners: Corners, width: int) -> Float32Array | None:
    """(T, 3, width) float32: a number is the same in all channels, a place has no third one."""
    if attribute is None or attribute.data_type not in CHANNELS:
        return None
    rows = corners.rows(attribute.domain)
    if rows is None:
        return None
    name, channel_count = CHANNELS[attribute.data_type]
    values = np.empty((len(attribute.data), channel_count), np.float32)
    attribute.data.foreach_get(name, values.reshape(-1))
    np.nan_to_num(values, copy=False, nan=0.0, posinf=65504.0, neginf=0.0)
    made = np.zeros((len(rows), 3, width), np.float32)
    made[..., : max(channel_count, width if channel_count == 1 else 0)] = values[rows][..., :width]
    return made


def read_round_uv_maps(data: Any, request: LayerRequest, kept: Kept) -> dict[str, Float32Array]:
    """(R, 2) float32 by name, of those that there are."""
    found: dict[str, Float32Array] = {}
    for name in request.uvs:
        values = _read_rows(data.attributes.get(name) if name else _first_of_curves(data), kept, 2)
        if values is not None:
            found[name] = values
    return found


def read_round_colors(data: Any, request: LayerRequest, kept: Kept) -> dict[str, Float32Array]:
    """(R, 3) float32, scene-linear, by name, of those that there are; none is active for renders."""
    found: dict[str, Float32Array] = {}
    for name in request.colors - {""}:
        values = _read_rows(data.attributes.get(name), kept, 3)
        if values is not None:
            found[name] = values
    return found


def _first_of_curves(data: Any) -> Any:
    fitting = (one for one in data.attributes if one.data_type == "FLOAT2" and one.domain == "CURVE")
    return next(fitting, None)


def _read_rows(attribute: Any, kept: Kept, width: int) -> Float32Array | None:
    """(R, width) float32: a number is the same in all channels, a place has no third one."""
    if attribute is None or attribute.data_type not in CHANNELS or attribute.domain not in {"POINT", "CURVE"}:
        return None
    name, channel_count = CHANNELS[attribute.data_type]
    values = np.empty((len(attribute.data), channel_count), np.float32)
    attribute.data.foreach_get(name, values.reshape(-1))
    rows = kept.points if attribute.domain == "POINT" else kept.curves
    if rows is not None:
        values = values[rows]
    np.nan_to_num(values, copy=False, nan=0.0, posinf=65504.0, neginf=0.0)
    made = np.zeros((len(values), width), np.float32)
    made[:, : max(channel_count, width if channel_count == 1 else 0)] = values[:, :width]
    return made
