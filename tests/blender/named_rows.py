"""Shared helpers for tests of unsupported features: a cube with a material, and the features named in its scene."""

from __future__ import annotations

from typing import Any

import bpy
from blender.builders import evaluated
from blender.node_setups import add, new_red, paint, shader
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.sync.not_shown import NotShown
from perfect_bvh_addon.sync.records import AttributeRequest

SHADING = AttributeRequest(shading=True)


def material_of_a_cube() -> Any:
    """The material of an object with a UV map and colours, alone under a plain world."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.world = bpy.data.worlds.new("World")
    bpy.ops.mesh.primitive_cube_add()
    material = new_red()
    bpy.context.object.data.materials.append(material)
    paint(bpy.context.object.data)
    return material


def rows(**options: Any) -> list[NotShown]:
    """Return the unsupported features of the scene in a mode that shows materials. options: of `read_scene`."""
    return list(read_scene(evaluated(), SHADING, **options).not_shown)


def sentences(**options: Any) -> list[str]:
    """Return the same rows as the sentences that users read."""
    return list(map(str, rows(**options)))


def link(material: Any, output: Any, name: str = "Base Color") -> None:
    """Link an output to an input of the material's Principled BSDF."""
    material.node_tree.links.new(output, shader(material).inputs[name])


def thick(material: Any) -> None:
    """Give it a volume."""
    tree = material.node_tree
    tree.links.new(add(tree, "VolumeScatter").outputs[0], tree.get_output_node("ALL").inputs["Volume"])


def into_color(material: Any) -> None:
    """Link an unsupported node to the material's Base Color."""
    link(material, add(material.node_tree, "AmbientOcclusion").outputs["Color"])
