"""No node is ignored silently: each of Blender's nodes is shown exactly or named, in docs/preview.md as well."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import pytest
from benchmarks.survey import read_groups
from blender.builders import evaluated
from blender.named_rows import SHADING, link, rows, sentences
from blender.node_setups import SETUPS, add, image_node, surface, tinted
from blender.textured_setups import TEXTURED
from perfect_bvh import nodes as programs
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.extract.looks.node_graph import IGNORED_INPUTS, SHOWN_NODES, SIMPLIFIED_NODES

# Nodes that are shown or not depending on the output, or on their inputs.
SHOWN_AT_TIMES = {
    "TEX_COORD",
    "NEW_GEOMETRY",
    "OBJECT_INFO",
    "ATTRIBUTE",
    "VERTEX_COLOR",
    "LIGHT_FALLOFF",
    "TEX_SKY",
    "TEX_IMAGE",
    "TEX_ENVIRONMENT",
    "BSDF_HAIR_PRINCIPLED",
}


def node_types() -> list[str]:
    """The identifiers of all shader nodes that this Blender has and that can be added."""
    tree = bpy.data.materials.new("probe")
    if not tree.node_tree:
        tree.use_nodes = True
    found = []
    for name in sorted(dir(bpy.types)):
        if name.startswith("ShaderNode") and name not in {"ShaderNode", "ShaderNodeTree", "ShaderNodeCustomGroup"}:
            tree.node_tree.nodes.new(name)
            found.append(name)
    bpy.data.materials.remove(tree)
    return found


def feed(material: Any, node: Any, output: Any) -> None:
    """Link a node's output to an input of the intended kind."""
    tree = material.node_tree
    if output.type == "SHADER":
        place = "Volume" if output.name == "Volume" else "Surface"
        tree.links.new(output, tree.get_output_node("ALL").inputs[place])
    elif node.type in {"DISPLACEMENT", "VECTOR_DISPLACEMENT"}:
        tree.links.new(output, tree.get_output_node("ALL").inputs["Displacement"])
    elif output.type == "VECTOR":
        image = image_node(tree)
        tree.links.new(output, image.inputs["Vector"])
        link(material, image.outputs["Color"])
    else:
        link(material, output)


@pytest.mark.parametrize("identifier", node_types())
def test_every_node_that_feeds_the_surface_is_shown_or_named(identifier: str, material: Any) -> None:
    node = material.node_tree.nodes.new(identifier)
    outputs = [output for output in node.outputs if output.enabled]
    if not outputs:
        assert node.type in SHOWN_NODES | {"OUTPUT_AOV", "OUTPUT_LINESTYLE", "SCRIPT"}, "nothing can be fed by it"
        return
    for output in outputs:
        feed(material, node, output)
        told = [row for row in rows() if node.bl_label in row.text]
        assert all((row.kind, row.name) == ("material", "Red") for row in told)
        assert len(told) <= 1, "each thing is told once"
        if node.type not in SHOWN_NODES:
            assert told, output.name
        elif node.type not in SHOWN_AT_TIMES:
            assert not told, output.name
    assert not (node.type in SHOWN_NODES and node.type in SIMPLIFIED_NODES)


@pytest.mark.parametrize("setup", [*SETUPS, *TEXTURED], ids=lambda setup: setup.__name__)
def test_what_is_shown_is_not_named(setup: Callable[[Any], None], material: Any) -> None:
    setup(material)
    assert sentences() == []


@pytest.mark.parametrize("limit", ["_MOST_INSTRUCTIONS", "_MOST_CHANNELS"])
def test_a_material_of_too_many_instructions_has_its_viewport_color(limit: str, material: Any, monkeypatch) -> None:
    tinted(material)
    material.diffuse_color = (0.1, 0.2, 0.7, 1.0)
    assert sentences() == []
    monkeypatch.setattr(programs, limit, 3)
    (told,) = sentences()
    assert told.startswith("Red: a node tree of more than 10,000 instructions")
    assert told.endswith("is unsupported; its viewport color is used")
    read = read_scene(evaluated(), SHADING).materials[0]
    assert read.program is None
    assert read.base_color == pytest.approx((0.1, 0.2, 0.7))


def test_an_unsupported_shader_is_to_be_replaced_and_another_node_to_be_baked(material: Any) -> None:
    tree = material.node_tree
    occlusion = add(tree, "AmbientOcclusion").outputs["Color"]
    tree.links.new(add(tree, "BsdfRayPortal", (occlusion, 0)).outputs[0], surface(material))
    portal, node = rows()
    assert portal.text.startswith("Ray Portal BSDF is ") and "another surface shader" in portal.what_to_do
    assert node.text.startswith("Ambient Occlusion is ") and "into an image texture" in node.what_to_do


def test_a_world_and_a_light_of_too_many_instructions_are_plain(material: Any, monkeypatch) -> None:
    world, light = bpy.context.scene.world, bpy.data.lights.new("Lamp", "POINT")
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Lamp", light))
    for block, kind in ((world, "BACKGROUND"), (light, "EMISSION")):
        block.use_nodes = True
        tree = block.node_tree
        color = add(tree, "Gamma", (image_node(tree).outputs["Color"], 0))
        shown = next(node for node in tree.nodes if node.type == kind)
        tree.links.new(color.outputs[0], shown.inputs["Color"])
    assert not any("10,000" in told for told in sentences())
    monkeypatch.setattr(programs, "_MOST_INSTRUCTIONS", 1)
    told = [(row.kind, row.text.split("; ")[1]) for row in rows() if "10,000" in row.text]
    assert sorted(told) == [("light", "its color is used"), ("world", "its viewport color is used")]


@pytest.mark.skipif(bpy.app.version < (5, 0, 0), reason="Blender before 5.0 lacks some of the inputs")
def test_the_table_names_inputs_that_blender_has(material: Any) -> None:
    found = {}
    for identifier in node_types():
        node = material.node_tree.nodes.new(identifier)
        found[node.type] = {socket.identifier for socket in node.inputs}
    for kind, inputs in IGNORED_INPUTS.items():
        assert {ignored.identifier for ignored in inputs} <= found[kind], kind


def test_the_documents_list_the_nodes_that_are_not_shown(material: Any, repository: Path) -> None:
    groups = read_groups((repository / "docs" / "preview.md").read_text(encoding="utf-8"))
    assert len(groups) < 15
    listed = {name for names in groups.values() for name in names}
    nodes = [material.node_tree.nodes.new(identifier) for identifier in node_types()]
    names = {node.bl_label for node in nodes if node.type not in SHOWN_NODES}
    in_part = {node.bl_label for node in nodes if node.type in SHOWN_AT_TIMES}
    shown = {node.bl_label for node in nodes} - names - in_part
    assert not listed & shown
    if bpy.app.version[:2] == (5, 0):  # others lack some, or have more
        assert names <= listed
    for inputs in IGNORED_INPUTS.values():
        assert {ignored.name for ignored in inputs} <= listed
