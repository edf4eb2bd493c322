"""One evaluated mesh -> one `MeshRecord`: triangles as Blender cuts them, and the attributes asked for."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from perfect_bvh.bulk import are_equal, are_triangles, copy_within

from ...sync.records import (
    LARGEST_COORDINATE,
    NO_LAYERS,
    AttributeRequest,
    Float32Array,
    Int32Array,
    LayerRequest,
    MeshRecord,
)
from ..pointer_views import (
    CORNER_NORMALS,
    CORNER_TRIANGLES,
    CORNER_UVS,
    CORNER_VERTS,
    FACE_INTEGERS,
    POSITIONS,
    TRIANGLE_POLYGONS,
    ArrayReader,
)
from .tangents import corner_tangents

# The uv maps and colours that materials name: of meshes a row a triangle, of hair and points one a curve or a point.
#
# As in Cycles, a name selects any uv map, colour attribute or attribute stored by geometry nodes. For curves, the uv
# map without a name is the first attribute with two numbers, which holds the root's position on the surface.


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
    """The indices of triangle corners' values, by an attribute's domain."""

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
    """Gathers the values of triangles' corners; Blender's own indices need no check of their range."""
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


# Meshes --------------------------------------------------------------------------------------------------------------


_zeros = np.zeros(0, np.int32)
_SAME_PLACE = 1e-5  # Blender stores undeformed places by their texture space, which rounds them


def read_mesh(
    mesh: Any,
    key: Hashable,
    name: str,
    attributes: AttributeRequest,
    layers: LayerRequest,
    reader: ArrayReader,
    last: MeshRecord | None = None,
) -> MeshRecord | None:
    """Reads an evaluated `bpy.types.Mesh`; None if it has no faces. Everything is copied.

    layers: the uv maps and colours that its materials show.
    last: the last reading, whose arrays replace equal ones: then nothing is copied or compared later.

    Triangles with a vertex that is not finite are dropped: no ray can hit them, and one of them would make every
    box around it useless.
    """
    mesh.calc_loop_triangles()
    triangle_count = len(mesh.loop_triangles)
    if triangle_count == 0:
        return None
    corner_triangles = reader.view(mesh.loop_triangles, CORNER_TRIANGLES, triangle_count)
    polygon_ids = reader.view(mesh.loop_triangle_polygons, TRIANGLE_POLYGONS, triangle_count)
    positions = reader.view(mesh.attributes["position"].data, POSITIONS)
    corner_verts = reader.view(mesh.attributes[".corner_vert"].data, CORNER_VERTS)
    if last is not None and are_triangles(corner_verts, corner_triangles, last.triangles):
        triangles = last.triangles
    else:  # Blender's own indices need no check of their range, which would take half the time
        triangles = np.take(corner_verts, corner_triangles, mode="clip")

    positions, kept = _read_positions(positions, triangles, None if last is None else last.positions)
    if kept is not None:
        triangles, corner_triangles, polygon_ids = triangles[kept], corner_triangles[kept], polygon_ids[kept]
    uv_maps: dict[str, Float32Array] = {}
    colors: dict[str, Float32Array] = {}
    corners = Corners(corner_triangles, triangles, polygon_ids)
    if layers is not NO_LAYERS:
        uv_maps, colors = read_uv_maps(mesh, layers, corners, reader), read_colors(mesh, layers, corners)
    normals = read_corner_normals(mesh, corner_triangles, reader) if attributes.corner_normals else None
    return MeshRecord(
        key=key,
        name=name,
        positions=positions,
        triangles=triangles,
        polygon_ids=_held(polygon_ids, last and last.polygon_ids),
        material_slots=_read_slots(mesh, polygon_ids, reader, last) if attributes.material_slots else None,
        corner_normals=normals,
        corner_uvs=uv_maps.pop("", None),
        corner_colors=colors.pop("", None),
        named_uvs=uv_maps,
        named_colors=colors,
        tangents=_read_tangents(mesh, layers, corners, positions[triangles], normals, reader)
        if layers.tangents
        else {},
        texture_space=_read_texture_space(mesh) if layers.generated else None,
        corner_generated=_read_generated(mesh, positions, triangles, last) if layers.generated else None,
        layers=layers,
        dropped_triangles=0 if kept is None else triangle_count - len(kept),
        triangle_ids=kept,
    )


def _read_tangents(
    mesh: Any,
    layers: LayerRequest,
    corners: Corners,
    places: Float32Array,
    normals: Float32Array | None,
    reader: ArrayReader,
) -> dict[str, Float32Array]:
    """(T, 3, 4) by the names of the uv maps that the mesh has."""
    maps = read_uv_maps(mesh, LayerRequest(uvs=layers.tangents), corners, reader)
    return {name: corner_tangents(places, normals, uvs) for name, uvs in maps.items()}


def _read_texture_space(mesh: Any) -> Float32Array:
    """(2, 3): factors and offsets of positions, which map them to 0 to 1 in the mesh's texture space."""
    size = np.array(mesh.texspace_size, np.float64)
    scale = np.divide(0.5, size, out=np.zeros(3), where=size != 0.0)
    return np.array([scale, 0.5 - np.array(mesh.texspace_location) * scale], np.float32)


def _read_generated(
    mesh: Any, positions: Float32Array, triangles: Int32Array, last: MeshRecord | None
) -> Float32Array | None:
    """(T, 3, 3): corners in the texture space as they were before they were deformed; None where nothing was."""
    places = np.empty_like(positions)
    mesh.vertices.foreach_get("undeformed_co", places.reshape(-1))
    space = _read_texture_space(mesh)
    made = places * space[0] + space[1]
    if np.allclose(made, positions * space[0] + space[1], rtol=0.0, atol=_SAME_PLACE):
        return None
    np.nan_to_num(made, copy=False, nan=0.0, posinf=0.0, neginf=0.0)
    return _held(made[triangles], last and last.corner_generated)


def _read_slots(mesh: Any, polygon_ids: Int32Array, reader: ArrayReader, last: MeshRecord | None) -> Int32Array:
    return read_material_slots(mesh, polygon_ids, reader, None if last is None else last.material_slots)


def _held(values: npt.NDArray[Any], last: npt.NDArray[Any] | None) -> npt.NDArray[Any]:
    """The last array if it is equal, else a copy of what may be Blender's own memory."""
    if last is not None and are_equal(values, last):
        return last
    return values if values.flags.owndata else values.copy()


def _read_positions(
    view: Float32Array, triangles: Int32Array, last: Float32Array | None
) -> tuple[Float32Array, Int32Array | None]:
    """Returns the last positions if they are equal, else a copy that the engine can hold; and which triangles to keep.

    The second value is None if all are kept. The last reading was already checked.
    """
    if last is not None and are_equal(view, last):
        return last, None
    positions = np.empty(view.shape, np.float32)
    if copy_within(view, positions, LARGEST_COORDINATE):
        return positions, None
    positions, kept = _without_infinities(positions, triangles)
    return _held(positions, last), kept


def _without_infinities(positions: Float32Array, triangles: Int32Array) -> tuple[Float32Array, Int32Array | None]:
    """Positions with a harmless value in place of each vertex that the engine cannot hold, and the triangles to keep.

    The row count stays, so that vertex ids keep their meaning. The second value is None if no triangle uses
    such a vertex.
    """
    finite = (np.abs(positions) <= LARGEST_COORDINATE).all(axis=1)
    kept = np.flatnonzero(finite[triangles].all(axis=1)).astype(np.int32)
    # A vertex that a kept triangle uses anyway, so that bounds taken over all vertices do not grow.
    harmless = positions[triangles[kept[0], 0]] if len(kept) else np.zeros(3, np.float32)
    positions[~finite] = harmless
    return positions, (kept if len(kept) < len(triangles) else None)


def read_material_slots(
    mesh: Any, polygon_ids: Int32Array, reader: ArrayReader, last: Int32Array | None = None
) -> Int32Array:
    """(T,) int32: the material slot of each triangle. Zero where the mesh has no slots; never negative.

    last: the last reading, whose array replaces an equal one.
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
