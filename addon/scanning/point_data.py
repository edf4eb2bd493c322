"""A point cloud as Blender's data: a Point Cloud where its Python can make one, else a mesh of vertices alone.

Either has the columns as attributes, which geometry nodes, shaders and exporters read. A mesh gets a modifier that
shows its vertices as points, so that both look alike.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ..extract.label_values import COLOR, OBJECT_NAMES, RADIUS
from ..settings.scan_choices import OTHER, find_color
from ..support.id_colors import id_colors
from .point_cloud import COLUMNS, Column, PointCloud, column_names

# A colour for each point from a column of numbers, vectors or ids. Does not depend on Blender.


Float32Array = npt.NDArray[np.float32]
Float64Array = npt.NDArray[np.float64]

# From low to high, in sRGB: yellow, green, blue, violet, of falling lightness.
RAMP = np.array([(253, 231, 37), (122, 209, 81), (34, 168, 132), (42, 120, 142), (65, 68, 135), (68, 1, 84)])
# The lowest and the highest hundredth get the ends, so that a single far point does not take all of the ramp.
RAMP_SHARES = (1.0, 99.0)
NOTHING = 0.2  # the grey, linear, of points without a value: no material, no label
# Columns of a cloud by the names that they have on points, of which the radii show the spacings.
COLOR_COLUMNS = {column.singular: name for name, column in COLUMNS.items() if name not in ("ray_ids", "spacings")}


def colors_of(cloud: PointCloud, color_by: str) -> Float32Array:
    """(N, 4) float32 scene-linear RGBA. color_by: the identifier of one of `POINT_COLORS`, such as "DISTANCE"."""
    color = find_color(color_by)
    values = getattr(cloud, COLOR_COLUMNS[color.column])
    # In the precision that attributes of points have: colours are the same from any source.
    kept = np.int32 if np.issubdtype(values.dtype, np.integer) else np.float32
    return colors_of_column(values.astype(kept), color.scale)


def colors_of_column(values: npt.NDArray[Any], scale: str) -> Float32Array:
    """Returns (N, 4) float32 scene-linear RGBA of (N,) or (N, 3) values. scale: as `PointColor` has it.

    Points without a value, with NaN or with an id below 0, are grey.
    """
    if scale == "ids":
        return _id_colors(values)
    if scale == "normal":
        return _opaque(_to_linear(np.clip(0.5 + 0.5 * values.astype(np.float64), 0.0, 1.0)))
    if scale == "grey":
        brightest = max(float(np.nanmax(values, initial=0.0)), 1e-6)
        return _opaque(np.repeat(values[:, None] / brightest, 3, axis=1))
    numbers = values.astype(np.float64)
    if scale == "height":
        numbers = numbers[:, 2]
    return _ramp_colors(np.log(np.maximum(numbers, 1e-9)) if scale == "near" else numbers)


def scale_of_column(values: npt.NDArray[Any]) -> str:
    """How a column is shown of which nothing is known but its numbers."""
    if values.ndim > 1:
        return "normal"
    return "ids" if np.issubdtype(values.dtype, np.integer) else "ramp"


def _ramp_colors(numbers: Float64Array) -> Float32Array:
    """Even steps of the ramp for even steps of the numbers."""
    has_value = np.isfinite(numbers)
    colors = np.full((len(numbers), 3), NOTHING)
    if has_value.any():
        first, last = np.percentile(numbers[has_value], RAMP_SHARES)
        places = (numbers[has_value] - first) / max(float(last - first), 1e-9)
        stops, ramp = np.linspace(0.0, 1.0, len(RAMP)), _to_linear(RAMP / 255.0)
        colors[has_value] = np.stack([np.interp(places, stops, ramp[:, channel]) for channel in range(3)], axis=1)
    return _opaque(colors)


def _id_colors(ids: npt.NDArray[np.integer[Any]]) -> Float32Array:
    known, rows = np.unique(ids, return_inverse=True)
    colors = _to_linear(id_colors(known))
    colors[known < 0] = NOTHING
    return _opaque(colors)[rows]


def _to_linear(srgb: Float64Array) -> Float64Array:
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _opaque(colors: npt.NDArray[np.floating[Any]]) -> Float32Array:
    found = np.ones((len(colors), 4), np.float32)
    found[:, :3] = colors
    return found


# Point nodes ---------------------------------------------------------------------------------------------------------
# The nodes that show points: a material of their colours, and a modifier that makes points of a mesh's vertices.


NAME = "Scan Points"
# From 5.0 on every material has nodes, and to ask is deprecated.
HAS_NODES_ALWAYS = bpy.app.version >= (5, 0, 0)


def point_material(attribute: str) -> bpy.types.Material:
    """A matte material whose colour is an attribute's; the one of the last scan, if it is still there."""
    found = next((known for known in bpy.data.materials if known.get(NAME) == attribute and not known.library), None)
    if found is not None:
        return found
    material: Any = bpy.data.materials.new(NAME)
    material[NAME] = attribute
    if not HAS_NODES_ALWAYS:
        material.use_nodes = True
    tree = material.node_tree
    shader = tree.nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value = 1.0
    shader.inputs["Specular IOR Level"].default_value = 0.0
    colors: Any = tree.nodes.new("ShaderNodeAttribute")
    colors.attribute_name = attribute
    colors.location = shader.location.x - 220, shader.location.y
    tree.links.new(colors.outputs["Color"], shader.inputs["Base Color"])
    return material


def add_points_modifier(obj: bpy.types.Object, material: bpy.types.Material) -> None:
    """Shows the vertices of a mesh as points, as large as their attribute "radius" says."""
    modifier: Any = obj.modifiers.new(NAME, "NODES")
    modifier.node_group = _points_group(material)


def _points_group(material: bpy.types.Material) -> bpy.types.NodeTree:
    group: Any = bpy.data.node_groups.new(NAME, "GeometryNodeTree")
    group.is_modifier = True
    for in_out in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
    kinds = ("NodeGroupInput", "GeometryNodeMeshToPoints", "GeometryNodeSetMaterial", "NodeGroupOutput")
    nodes = [group.nodes.new(kind) for kind in kinds]
    for place, node in enumerate(nodes):
        node.location = 220.0 * place, 0.0
    _, points, shown, _ = nodes
    radius: Any = group.nodes.new("GeometryNodeInputNamedAttribute")
    radius.data_type = "FLOAT"
    radius.inputs["Name"].default_value = "radius"
    radius.location = 0.0, -140.0
    shown.inputs["Material"].default_value = material
    for left, right in pairwise(nodes):
        group.links.new(left.outputs[0], right.inputs[0])
    group.links.new(radius.outputs["Attribute"], points.inputs["Radius"])
    return group


# Point data ----------------------------------------------------------------------------------------------------------


POSITION = "position"


def _kind_of(column: Column) -> tuple[str, str]:
    """Returns an attribute's type, and the field of its values."""
    if column.row:
        return "FLOAT_VECTOR", "vector"
    return "INT" if np.issubdtype(column.dtype, np.integer) else "FLOAT", "value"


# Attribute, its type, the field of its values, the column.
ATTRIBUTES = tuple(
    (attribute, *_kind_of(COLUMNS[name]), name) for attribute, name in COLOR_COLUMNS.items() if attribute != POSITION
)
MATERIAL_NAMES = "material_names"
LABELS = "labels"
HAS_RESIZE = "resize" in bpy.types.PointCloud.bl_rna.functions
# Fields and widths of the values of attributes whose numbers can be shown as colours.
SHOWN_TYPES = {"FLOAT": ("value", 1), "INT": ("value", 1), "FLOAT_VECTOR": ("vector", 3)}


def make_point_object(cloud: PointCloud, name: str, color_by: str = "DISTANCE", column: str = "") -> bpy.types.Object:
    """Makes an object in no collection, its points in world space, with the attributes of `ATTRIBUTES` on them.

    Further attributes are "radius", so that neighbours touch where they were hit perpendicularly, and "Color", linear
    RGBA, by the arguments of `color_points`; its material shows it. The custom properties "object_names" and
    "material_names" of the object's data list the names for object_id and material_id. Labels are attributes of their
    names, whole numbers or floats; "labels", a text of JSON, describes their values.
    """
    make = _make_point_cloud if HAS_RESIZE else _make_converted
    data = make(cloud, name, (color_by, column))
    data[OBJECT_NAMES], data[MATERIAL_NAMES] = list(cloud.object_names), list(cloud.material_names)
    if cloud.labels:
        data[LABELS] = json.dumps(cloud.described_labels(column_names(cloud.labels)))
    made = bpy.data.objects.new(name, data)
    if isinstance(data, bpy.types.Mesh):
        add_points_modifier(made, data.materials[0])
    return made


def column_names_of_points() -> list[str]:
    """Returns the names of the attributes that all points have and that `color_points` can show."""
    return sorted([POSITION, RADIUS, *(name for name, *_ in ATTRIBUTES)])


def _make_point_cloud(cloud: PointCloud, name: str, color_by: tuple[str, str]) -> Any:
    made: Any = bpy.data.pointclouds.new(name)
    try:
        made.resize(len(cloud))
        _set_position(made.attributes[POSITION].data, "vector", cloud)
        _add_attributes(made, cloud, color_by)
    except BaseException:
        bpy.data.pointclouds.remove(made)
        raise
    return made


def _make_converted(cloud: PointCloud, name: str, color_by: tuple[str, str]) -> Any:
    return _convert(_make_mesh(cloud, name, color_by))


def _convert(mesh: bpy.types.Mesh) -> Any:
    """The mesh as a Point Cloud by Blender's own operator, and the mesh is gone; the mesh where there is no such."""
    if "POINTCLOUD" not in bpy.ops.object.convert.get_rna_type().properties["target"].enum_items:
        return mesh
    holder = bpy.data.objects.new(mesh.name, mesh)
    bpy.context.scene.collection.objects.link(holder)
    chosen = dict.fromkeys(("active_object", "object"), holder)
    lists = {key: [holder] for key in ("selected_objects", "selected_editable_objects")}
    try:
        with bpy.context.temp_override(**chosen, **lists):
            if bpy.ops.object.convert.poll():
                bpy.ops.object.convert(target="POINTCLOUD")
        made = holder.data
    finally:
        bpy.data.objects.remove(holder)
    if made != mesh:
        bpy.data.meshes.remove(mesh)
    return made


def _make_mesh(cloud: PointCloud, name: str, color_by: tuple[str, str]) -> bpy.types.Mesh:
    mesh = bpy.data.meshes.new(name)
    try:
        mesh.vertices.add(len(cloud))
        _set_position(mesh.vertices, "co", cloud)
        _add_attributes(mesh, cloud, color_by)
        mesh.update()
    except BaseException:
        bpy.data.meshes.remove(mesh)
        raise
    return mesh


def _set_position(points: Any, field: str, cloud: PointCloud) -> None:
    points.foreach_set(field, np.ascontiguousarray(cloud.positions, np.float32).ravel())


def _add_attributes(data: Any, cloud: PointCloud, color_by: tuple[str, str]) -> None:
    for attribute, kind, part, column in ATTRIBUTES:
        values = np.ascontiguousarray(getattr(cloud, column), np.int32 if kind == "INT" else np.float32)
        data.attributes.new(attribute, kind, "POINT").data.foreach_set(part, values.ravel())
    for name, column in column_names(cloud.labels).items():
        table, values = cloud.labels[name].table, cloud.labels[name].values
        kind, dtype = ("INT", np.int32) if table.is_whole else ("FLOAT", np.float32)
        data.attributes.new(column, kind, "POINT").data.foreach_set("value", values.astype(dtype))
    data.attributes.new(RADIUS, "FLOAT", "POINT").data.foreach_set("value", 0.5 * cloud.spacings)
    data.attributes.new(COLOR, "FLOAT_COLOR", "POINT")
    color_points(data, *color_by)
    data.materials.append(point_material(COLOR))


def color_points(data: Any, color_by: str = "DISTANCE", column: str = "") -> None:
    """Colours the points of a scan by one of their attributes, once more if they have colours.

    data: of a Point Cloud or mesh that `make_point_object` has made. color_by: an identifier of `POINT_COLORS`, such as
    "DISTANCE", or "COLUMN": then by the attribute of the name `column`, whole numbers as ids, others along a ramp,
    vectors as directions. Raises ValueError for an attribute that the points do not have, or that is no number.
    """
    scale = None
    if color_by != OTHER:
        color = find_color(color_by)
        column, scale = color.column, color.scale
    values = read_column(data, column)
    colors = colors_of_column(values, scale or scale_of_column(values))
    data.attributes[COLOR].data.foreach_set("color", colors.ravel())
    data.update_tag()


def read_column(data: Any, name: str) -> npt.NDArray[Any]:
    """(N,) int32 or float32, or (N, 3) float32, of the points of a scan.

    Raises ValueError, with the names that there are, for an attribute that they do not have, or that is no number.
    """
    found = data.attributes.get(name)
    if found is None or found.domain != "POINT" or found.data_type not in SHOWN_TYPES:
        names = sorted(
            each.name
            for each in data.attributes
            if each.domain == "POINT" and each.data_type in SHOWN_TYPES and not each.name.startswith(".")
        )
        raise ValueError(f"color_points: the points of {data.name!r} have no column {name!r}, but {', '.join(names)}")
    field, width = SHOWN_TYPES[found.data_type]
    values = np.empty(len(found.data) * width, np.int32 if found.data_type == "INT" else np.float32)
    found.data.foreach_get(field, values)
    return values if width == 1 else values.reshape(-1, width)


# Read again ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """The look of N points. positions: (N, 3) in object space. radii: (N,). colors: (N, 4) linear. All float32."""

    positions: npt.NDArray[np.float32]
    radii: npt.NDArray[np.float32]
    colors: npt.NDArray[np.float32]

    def equals(self, other: Points) -> bool:
        """Whether they are alike in all."""
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in self.__slots__)


def may_have_points() -> bool:
    """Whether the file may hold a scan; quick to ask where it holds none."""
    return any(OBJECT_NAMES in data for data in bpy.data.pointclouds) or NAME in bpy.data.node_groups


def read_points(data: Any) -> Points:
    """Reads the data of an object that has points (`extract/label_values.py`)."""
    columns = ((POSITION, "vector", 3), (RADIUS, "value", 1), (COLOR, "color", 4))
    found = []
    for name, part, width in columns:
        values = data.attributes[name].data
        column = np.empty(len(values) * width, np.float32)
        values.foreach_get(part, column)
        found.append(column if width == 1 else column.reshape(-1, width))
    return Points(*found)
