"""A point cloud as a mesh of vertices alone, with the columns as attributes: geometry nodes and exporters read them."""

from __future__ import annotations

import bpy
import numpy as np

from .point_cloud import PointCloud

# Attribute, its type, the field of its values, the column.
ATTRIBUTES = (
    ("distance", "FLOAT", "value", "distances"),
    ("normal", "FLOAT_VECTOR", "vector", "normals"),
    ("object_id", "INT", "value", "object_ids"),
    ("instance_id", "INT", "value", "instance_ids"),
    ("material_id", "INT", "value", "material_ids"),
    ("time", "FLOAT", "value", "times"),
)


def make_point_mesh(cloud: PointCloud, name: str) -> bpy.types.Mesh:
    """A new mesh with one vertex a point, in world space, and the attributes of `ATTRIBUTES` on them.

    Its custom properties "object_names" and "material_names" hold what object_id and material_id are rows of.
    """
    mesh = bpy.data.meshes.new(name)
    try:
        mesh.vertices.add(len(cloud))
        mesh.vertices.foreach_set("co", np.ascontiguousarray(cloud.positions, np.float32).ravel())
        for attribute, kind, field, column in ATTRIBUTES:
            values = np.ascontiguousarray(getattr(cloud, column), np.int32 if kind == "INT" else np.float32)
            mesh.attributes.new(attribute, kind, "POINT").data.foreach_set(field, values.ravel())
        mesh["object_names"] = list(cloud.object_names)
        mesh["material_names"] = list(cloud.material_names)
        mesh.update()
    except BaseException:
        bpy.data.meshes.remove(mesh)
        raise
    return mesh
