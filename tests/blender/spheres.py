"""Spheres that are identical in every process."""

from __future__ import annotations

from typing import Any

import bpy


def add_uv_sphere(**options: Any) -> None:
    """Add a UV sphere whose faces and edges have a fixed order; that of `primitive_uv_sphere_add` varies by process."""
    bpy.ops.mesh.primitive_uv_sphere_add(**options)
    mesh = bpy.context.object.data
    uvs = {
        tuple(face.vertices): [mesh.uv_layers[0].uv[i].vector[:] for i in face.loop_indices] for face in mesh.polygons
    }
    positions, faces = [vertex.co[:] for vertex in mesh.vertices], sorted(uvs)
    mesh.clear_geometry()
    mesh.from_pydata(positions, [], faces)
    corners = [number for face in faces for uv in uvs[face] for number in uv]
    mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", corners)
