"""Meshes whose trees take a while to build; tests in windows, whose Blender has no pytest, use them too."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np


def add_cloud(triangle_count: int, seed: int = 0) -> Any:
    """An object of small triangles anywhere in a cube of side 20; most rays from its middle hit one."""
    random = np.random.default_rng(seed)
    centres = random.uniform(-10.0, 10.0, (triangle_count, 1, 3))
    corners = centres + random.normal(scale=0.1, size=(triangle_count, 3, 3))
    mesh = bpy.data.meshes.new("Cloud")
    mesh.vertices.add(3 * triangle_count)
    mesh.loops.add(3 * triangle_count)
    mesh.polygons.add(triangle_count)
    mesh.vertices.foreach_set("co", corners.astype(np.float32).ravel())
    mesh.loops.foreach_set("vertex_index", np.arange(3 * triangle_count, dtype=np.int32))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * triangle_count, 3, dtype=np.int32))
    mesh.update()
    made = bpy.data.objects.new("Cloud", mesh)
    bpy.context.scene.collection.objects.link(made)
    bpy.context.view_layer.update()
    return made
