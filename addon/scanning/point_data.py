"""A point cloud as Blender's data: a Point Cloud where its Python can make one, else a mesh of vertices alone.

Either has the columns as attributes, which geometry nodes, shaders and exporters read. A mesh gets a modifier that
shows its vertices as points, so that both look alike.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from .point_cloud import PointCloud
from .point_colors import colors_of
from .point_nodes import add_points_modifier, point_material

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
)
# Cycles finds no attribute that is called "color" on points.
COLOR, RADIUS = "Color", "radius"
HAS_RESIZE = "resize" in bpy.types.PointCloud.bl_rna.functions


def make_point_object(cloud: PointCloud, name: str, color_by: str = "DISTANCE") -> bpy.types.Object:
    """A new object in no collection, its points in world space, with the attributes of `ATTRIBUTES` on them.

    Beside these are "radius", so that neighbours touch where they were met straight on, and "Color", linear RGBA, by
    distance, object or intensity (`color_by`); its material shows it. The custom properties "object_names" and
    "material_names" of the object's data hold what object_id and material_id are rows of.
    """
    make = _make_point_cloud if HAS_RESIZE else _make_converted
    data = make(cloud, name, color_by)
    data["object_names"], data["material_names"] = list(cloud.object_names), list(cloud.material_names)
    made = bpy.data.objects.new(name, data)
    if isinstance(data, bpy.types.Mesh):
        add_points_modifier(made, data.materials[0])
    return made


def _make_point_cloud(cloud: PointCloud, name: str, color_by: str) -> Any:
    made: Any = bpy.data.pointclouds.new(name)
    try:
        made.resize(len(cloud))
        _set_position(made.attributes["position"].data, "vector", cloud)
        _add_attributes(made, cloud, color_by)
    except BaseException:
        bpy.data.pointclouds.remove(made)
        raise
    return made


def _make_converted(cloud: PointCloud, name: str, color_by: str) -> Any:
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


def _make_mesh(cloud: PointCloud, name: str, color_by: str) -> bpy.types.Mesh:
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


def _add_attributes(data: Any, cloud: PointCloud, color_by: str) -> None:
    for attribute, kind, field, column in ATTRIBUTES:
        values = np.ascontiguousarray(getattr(cloud, column), np.int32 if kind == "INT" else np.float32)
        data.attributes.new(attribute, kind, "POINT").data.foreach_set(field, values.ravel())
    data.attributes.new(RADIUS, "FLOAT", "POINT").data.foreach_set("value", 0.5 * cloud.spacings)
    colors = data.attributes.new(COLOR, "FLOAT_COLOR", "POINT")
    colors.data.foreach_set("color", colors_of(cloud, color_by).ravel())
    data.materials.append(point_material(COLOR))
