"""Results of nodes that no picture shows: keys of images, repeated reading, nodes whose values cannot be known."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from blender.builders import evaluated, mesh_object
from blender.node_setups import add, grouped, image_node, new_red, shader, surface
from blender.program_slots import slots_of
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.extract.looks.values import blackbody
from perfect_bvh_addon.extract.scene import ReadCache
from perfect_bvh_addon.sync.records import AttributeRequest, SceneRecord

SHADING = AttributeRequest(shading=True)


@pytest.fixture
def material() -> object:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    material = new_red()
    mesh_object("object").data.materials.append(material)
    return material


def read(cache: ReadCache | None = None) -> SceneRecord:
    return read_scene(evaluated(), SHADING, cache=cache)


def test_an_image_is_read_once_whatever_nodes_make_of_it(material) -> None:
    tree = material.node_tree
    darker = add(tree, "Gamma", (image_node(tree).outputs[0], 0), Gamma=2.0)
    tree.links.new(darker.outputs[0], shader(material).inputs["Base Color"])
    cache = ReadCache()
    first, second = (read(cache) for _ in range(2))
    assert first.images[0].pixels is second.images[0].pixels
    assert first.materials == second.materials
    darker.inputs["Gamma"].default_value = 1.0
    third = read(cache)
    assert third.images[0].pixels is first.images[0].pixels
    assert third.materials != first.materials


def test_one_image_in_several_uses_has_one_row(material) -> None:
    tree = material.node_tree
    image = image_node(tree)
    tree.links.new(image.outputs[0], shader(material).inputs["Base Color"])
    tree.links.new(image.outputs[0], shader(material).inputs["Emission Color"])
    shader(material).inputs["Emission Strength"].default_value = 2.0
    record = read()
    assert len(record.images) == 1
    assert set(slots_of(record.materials[0].program)) == {"COLOR", "EMISSION"}
    mapping = add(tree, "Mapping", Scale=(4.0, 4.0, 4.0))
    other = tree.nodes.new("ShaderNodeTexImage")
    other.image = image.image
    tree.links.new(mapping.outputs[0], other.inputs[0])
    tree.links.new(other.outputs[0], shader(material).inputs["Emission Color"])
    assert len(read().images) == 1
    other.extension = "CLIP"
    record = read()
    assert [image.extension for image in record.images] == ["repeat", "clip"]
    assert record.images[0].pixels is record.images[1].pixels


def test_a_field_has_the_mean_of_what_a_program_sets(material) -> None:
    tree = material.node_tree
    tree.links.new(image_node(tree).outputs[0], shader(material).inputs["Roughness"])
    record = read()
    pixels = np.array(bpy.data.images["Four"].pixels[:]).reshape(-1, 4)
    bytes_ = np.rint(pixels[:, :3] * 255) / 255
    linear = np.where(bytes_ <= 0.04045, bytes_ / 12.92, ((bytes_ + 0.055) / 1.055) ** 2.4)
    assert record.materials[0].roughness == pytest.approx((linear @ (0.2126, 0.7152, 0.0722)).mean(), abs=0.02)


def test_a_missing_image_is_named_at_every_reading(material) -> None:
    tree = material.node_tree
    image = tree.nodes.new("ShaderNodeTexImage")
    image.image = bpy.data.images.new("gone", 1, 1)
    image.image.source, image.image.filepath = "FILE", "//nowhere.png"
    tree.links.new(add(tree, "Invert", (image.outputs[0], 1)).outputs[0], shader(material).inputs["Base Color"])
    cache = ReadCache()
    for _ in range(2):
        assert [warning for warning in read(cache).warnings if "gone" in warning]


def test_a_group_that_holds_nothing_is_black(material) -> None:
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = bpy.data.node_groups.new("Empty", "ShaderNodeTree")
    node.node_tree.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    tree.links.new(node.outputs[0], surface(material))
    assert read().materials[0].base_color == (0.0, 0.0, 0.0)


def test_two_uses_of_one_group_are_told_apart(material) -> None:
    tree = material.node_tree
    grouped(material)
    first = next(node for node in tree.nodes if node.type == "GROUP")
    second = tree.nodes.new("ShaderNodeGroup")
    second.node_tree = first.node_tree
    second.inputs[0].default_value = (0.0, 0.0, 0.0, 1.0)
    mix = add(tree, "MixShader", (first.outputs[0], 1), (second.outputs[0], 2), Fac=0.0)
    tree.links.new(mix.outputs[0], surface(material))
    means = []
    for share in (0.0, 1.0):
        mix.inputs[0].default_value = share
        means.append(max(read().materials[0].base_color))
    assert means[0] > 0.1
    assert means[1] == 0.0


def test_black_bodies_have_their_colors() -> None:
    for kelvin, is_warm in ((1000.0, True), (3000.0, True), (12000.0, False)):
        red, green, blue = blackbody(kelvin).tolist()
        assert 0.2126 * red + 0.7152 * green + 0.0722 * blue == pytest.approx(1.0, abs=0.12)
        assert (red > blue) == is_warm
    assert max(blackbody(6500.0)) - min(blackbody(6500.0)) < 0.1
