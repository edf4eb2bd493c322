"""The nodes that show points: a material of their colours, and a modifier that makes points of a mesh's vertices."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import bpy

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
