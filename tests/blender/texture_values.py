"""Values of Cycles' texture nodes at given points, without noise or filter.

Each point has one quad of a plane, which one pixel shows. The point's coordinates are attributes of the quad. The
node's outputs are written as shader AOVs, which keep values that are negative or above 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import bpy
import numpy as np
from oracles.cycles import FILTER_WIDTH, preserved, render_planes

LEAST_SIZE = 4  # of an image, in pixels: Blender's minimum
Array = np.ndarray
MakeNode = Callable[[Any], Any]


def cycles_values(make_node: MakeNode, points: Array, w: Array, *output_names: str) -> list[Array]:
    """Cycles' values of a node's outputs: one float32 array for each, (N,) of numbers, (N, 3) of colours or vectors.

    make_node: makes the node in the material's tree that it is given. Its inputs Vector and W, if it has them, are
    linked to the coordinates. points: (N, 3). w: (N,). Replaces Blender's current file by an empty one.
    """
    columns = max(math.ceil(math.sqrt(len(points))), LEAST_SIZE)
    rows = max(math.ceil(len(points) / columns), LEAST_SIZE)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    mesh = _grid_of_quads(columns, rows, points, w)
    scene.collection.objects.link(bpy.data.objects.new("Points", mesh))
    _aim_camera(scene, columns, rows)
    channels = _write_outputs(scene, mesh, make_node, output_names)
    cycles = scene.cycles
    with preserved(
        (cycles, "device", "CPU"),
        (cycles, "samples", 1),
        (cycles, "use_adaptive_sampling", False),
        (cycles, "use_denoising", False),
        (cycles, "pixel_filter_type", "BLACKMAN_HARRIS"),
        (cycles, "filter_width", FILTER_WIDTH),
        (cycles, "max_bounces", 0),
    ):
        planes = render_planes(scene, "CYCLES", [name for names in channels for name in names])
    # Row 0 of an image is on top.
    values = [np.stack([planes[name][::-1].ravel() for name in names], axis=-1)[: len(points)] for names in channels]
    return [value if value.shape[1] > 1 else value[:, 0] for value in values]


def _grid_of_quads(columns: int, rows: int, points: Array, w: Array) -> Any:
    """A plane of squares of size 1, row by row from the origin; those without a point have zeros."""
    row, column = np.mgrid[0 : rows + 1, 0 : columns + 1]
    vertices = np.stack([column, row, np.zeros_like(row)], axis=-1).astype(np.float32)
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    corners = first[:, None] + [0, 1, columns + 2, columns + 1]
    mesh = bpy.data.meshes.new("Points")
    mesh.vertices.add(vertices.size // 3)
    mesh.vertices.foreach_set("co", vertices.ravel())
    mesh.loops.add(corners.size)
    mesh.loops.foreach_set("vertex_index", corners.ravel().astype(np.int32))
    mesh.polygons.add(len(first))
    mesh.polygons.foreach_set("loop_start", np.arange(0, corners.size, 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    for name, kind, key, values in (("p", "FLOAT_VECTOR", "vector", points), ("w", "FLOAT", "value", w)):
        data = np.zeros((len(first), *np.shape(values)[1:]), np.float32)
        data[: len(values)] = values
        mesh.attributes.new(name, kind, "FACE").data.foreach_set(key, data.ravel())
    return mesh


def _aim_camera(scene: Any, columns: int, rows: int) -> None:
    """Aim the camera so that each square is one pixel."""
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale, camera.sensor_fit = "ORTHO", columns, "HORIZONTAL"
    head = bpy.data.objects.new("Camera", camera)
    head.location = (columns / 2, rows / 2, 1.0)
    scene.collection.objects.link(head)
    scene.camera = head
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = columns, rows, 100


def _write_outputs(scene: Any, mesh: Any, make_node: MakeNode, output_names: Sequence[str]) -> list[list[str]]:
    """Give the mesh a material whose AOVs are the node's outputs; the names of each one's planes."""
    material = bpy.data.materials.new("Texture")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    mesh.materials.append(material)
    tree = material.node_tree
    node = make_node(tree)
    for name, attribute, output in (("Vector", "p", "Vector"), ("W", "w", "Fac")):
        if name in node.inputs:
            source = tree.nodes.new("ShaderNodeAttribute")
            source.attribute_name = attribute
            tree.links.new(source.outputs[output], node.inputs[name])
    channels = []
    for name in output_names:
        output = next(socket for socket in node.outputs if socket.identifier == name)
        is_number = output.type == "VALUE"
        aov = scene.view_layers[0].aovs.add()
        aov.name, aov.type = f"AOV {name}", "VALUE" if is_number else "COLOR"
        target = tree.nodes.new("ShaderNodeOutputAOV")
        target.aov_name = aov.name
        tree.links.new(output, target.inputs["Value" if is_number else "Color"])
        channels.append([f"{aov.name}.{channel}" for channel in ("X" if is_number else "RGB")])
    return channels
