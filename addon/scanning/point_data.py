"""A point cloud as Blender's data: a Point Cloud where its Python can make one, else a mesh of vertices alone.

Either has the columns as attributes, which geometry nodes, shaders and exporters read. A mesh gets a modifier that
shows its vertices as points, so that both look alike.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ..extract.scans import COLOR, OBJECT_NAMES, RADIUS
from ..settings.point_color_items import OTHER, find_color
from .point_cloud import PointCloud, column_names
from .point_colors import colors_of_column, scale_of_column
from .point_nodes import NAME, add_points_modifier, point_material

# Attribute, its type, the field of its values, the column.
ATTRIBUTES = (
    ("distance", "FLOAT", "value", "distances"),
    ("normal", "FLOAT_VECTOR", "vector", "normals"),
    ("object_id", "INT", "value", "object_ids"),
    ("instance_id", "INT", "value", "instance_ids"),
    ("material_id", "INT", "value", "material_ids"),
    ("time", "FLOAT", "value", "times"),
    ("ring", "INT", "value", "ring_ids"),
    ("incidence", "FLOAT", "value", "incidences"),
    ("intensity", "FLOAT", "value", "intensities"),
    ("return_id", "INT", "value", "return_ids"),
    ("return_count", "INT", "value", "return_counts"),
)
POSITION = "position"
MATERIAL_NAMES = "material_names"
LABELS = "labels"
HAS_RESIZE = "resize" in bpy.types.PointCloud.bl_rna.functions
# Fields and widths of the values of attributes whose numbers can be shown as colours.
SHOWN_TYPES = {"FLOAT": ("value", 1), "INT": ("value", 1), "FLOAT_VECTOR": ("vector", 3)}


def make_point_object(cloud: PointCloud, name: str, color_by: str = "DISTANCE", column: str = "") -> bpy.types.Object:
    """A new object in no collection, its points in world space, with the attributes of `ATTRIBUTES` on them.

    Beside these are "radius", so that neighbours touch where they were met straight on, and "Color", linear RGBA, by
    what `color_points` takes; its material shows it. The custom properties "object_names" and "material_names" of the
    object's data hold what object_id and material_id are rows of. Labels are attributes of their names, whole numbers
    or floats; "labels", a text of JSON, says what their values stand for.
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
    """Of the attributes that all points have and that `color_points` can show."""
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
    for attribute, kind, field, column in ATTRIBUTES:
        values = np.ascontiguousarray(getattr(cloud, column), np.int32 if kind == "INT" else np.float32)
        data.attributes.new(attribute, kind, "POINT").data.foreach_set(field, values.ravel())
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
    """What is seen of N points. positions: (N, 3) in object space. radii: (N,). colors: (N, 4) linear. All float32."""

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
    """Of the data of an object that has points (`extract/scans.py`)."""
    columns = ((POSITION, "vector", 3), (RADIUS, "value", 1), (COLOR, "color", 4))
    found = []
    for name, field, width in columns:
        values = data.attributes[name].data
        column = np.empty(len(values) * width, np.float32)
        values.foreach_get(field, column)
        found.append(column if width == 1 else column.reshape(-1, width))
    return Points(*found)
