"""Results of node trees whose nodes are muted, belong to other engines, or have no output. The values are Cycles'.

Each setup was rendered with Cycles of Blender 5.0.1; the numbers are those of its picture.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import bpy
import pytest
from blender.builders import evaluated, mesh_object
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.sync.records import AttributeRequest, SceneRecord

SHADING = AttributeRequest(shading=True)
OWN, OTHER, BLACK = (0.2, 0.3, 0.4), (0.9, 0.1, 0.1), (0.0, 0.0, 0.0)


@pytest.fixture
def material() -> Any:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    material = bpy.data.materials.new("Material")
    material.use_nodes = True
    material.diffuse_color = (0.1, 0.9, 0.1, 1.0)
    mesh_object("object").data.materials.append(material)
    return material


@pytest.fixture
def foreign() -> Iterator[str]:
    """A node of another render engine."""

    class Foreign(bpy.types.ShaderNode):
        bl_idname, bl_label = "ForeignNode", "Foreign"

        def init(self, context: Any) -> None:
            self.outputs.new("NodeSocketColor", "Color")
            self.outputs.new("NodeSocketShader", "Shader")

    bpy.utils.register_class(Foreign)
    yield "ForeignNode"
    bpy.utils.unregister_class(Foreign)


def read() -> SceneRecord:
    return read_scene(evaluated(), SHADING)


def named(scene: SceneRecord, kind: str) -> list[str]:
    return [row.text for row in scene.not_shown if row.kind == kind]


def output_of(tree: Any) -> Any:
    return next(node for node in tree.nodes if node.bl_idname.startswith("ShaderNodeOutput"))


def shine(tree: Any, color: tuple[float, float, float] = OWN) -> Any:
    """Link an Emission of this colour to the output."""
    node = tree.nodes.new("ShaderNodeEmission")
    node.inputs["Color"].default_value = (*color, 1.0)
    tree.links.new(node.outputs[0], output_of(tree).inputs["Surface"])
    return node


def feed(tree: Any, kind: str, socket: Any, output: int = 0, *, mute: bool = True) -> Any:
    node = tree.nodes.new(kind)
    node.mute = mute
    tree.links.new(node.outputs[output], socket)
    return node


def make_group(tree: Any, fill: Callable[[Any], None]) -> Any:
    """Make a node of a group with a colour input and a colour output."""
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    for in_out in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Color", in_out=in_out, socket_type="NodeSocketColor")
    fill(group)
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    return node


def color(tree: Any) -> None:
    feed(tree, "ShaderNodeRGB", shine(tree).inputs["Color"])


def number(tree: Any) -> None:
    emission = shine(tree)
    feed(tree, "ShaderNodeValue", emission.inputs["Strength"]).outputs[0].default_value = 5.0


def texture(tree: Any) -> None:
    feed(tree, "ShaderNodeAmbientOcclusion", shine(tree).inputs["Color"], 1)


def unfed_gamma(tree: Any) -> None:
    """The value of the muted node's unlinked input does not count."""
    feed(tree, "ShaderNodeGamma", shine(tree).inputs["Color"]).inputs["Color"].default_value = (*OTHER, 1.0)


def behind_a_reroute(tree: Any) -> None:
    feed(tree, "ShaderNodeRGB", feed(tree, "NodeReroute", shine(tree).inputs["Color"], mute=False).inputs[0])


def muted_link(tree: Any) -> None:
    emission = shine(tree)
    feed(tree, "ShaderNodeRGB", emission.inputs["Color"], mute=False)
    emission.inputs["Color"].links[0].is_muted = True


def shader_into_a_color(tree: Any) -> None:
    """Blender draws such a link in red."""
    feed(tree, "ShaderNodeBsdfDiffuse", shine(tree).inputs["Color"], mute=False)


def within_a_group(tree: Any) -> None:
    """The input of the group's output node has another value."""

    def fill(group: Any) -> None:
        end = group.nodes.new("NodeGroupOutput")
        end.inputs[0].default_value = (*OTHER, 1.0)
        feed(group, "ShaderNodeRGB", end.inputs[0])

    tree.links.new(make_group(tree, fill).outputs[0], shine(tree).inputs["Color"])


def before_a_group(tree: Any) -> None:
    def fill(group: Any) -> None:
        start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
        group.links.new(start.outputs[0], end.inputs[0])

    node = make_group(tree, fill)
    node.inputs[0].default_value = (*OTHER, 1.0)
    feed(tree, "ShaderNodeRGB", node.inputs[0])
    tree.links.new(node.outputs[0], shine(tree).inputs["Color"])


def passed_through(tree: Any) -> None:
    """A Checker Texture passes on its first colour."""
    checker = feed(tree, "ShaderNodeTexChecker", shine(tree).inputs["Color"])
    feed(tree, "ShaderNodeRGB", checker.inputs["Color1"], mute=False).outputs[0].default_value = (*OTHER, 1.0)


def muted_emission(tree: Any) -> None:
    shine(tree).mute = True


def mixed(tree: Any) -> None:
    """A Mix Shader passes on its linked input."""
    emission = shine(tree)
    mix = feed(tree, "ShaderNodeMixShader", output_of(tree).inputs["Surface"])
    tree.links.new(emission.outputs[0], mix.inputs[2])


def muted_output(tree: Any) -> None:
    shine(tree)
    output_of(tree).mute = True


def no_output(tree: Any) -> None:
    tree.nodes.clear()


def other_engine(tree: Any) -> None:
    shine(tree)
    output_of(tree).target = "EEVEE"


def color_into_surface(tree: Any) -> None:
    feed(tree, "ShaderNodeRGB", output_of(tree).inputs["Surface"], mute=False).outputs[0].default_value = (*OTHER, 1.0)


def output_within(tree: Any, *, target: str = "ALL", mute: bool = False) -> None:
    """A group contains an output of the same kind, whose colour is OTHER."""
    kind = output_of(tree).bl_idname

    def fill(group: Any) -> None:
        group.nodes.new(kind).target = target
        shine(group, OTHER)

    make_group(tree, fill).mute = mute


def output_only_within(tree: Any) -> None:
    output_within(tree)
    tree.nodes.remove(output_of(tree))


def output_in_a_muted_group(tree: Any) -> None:
    output_within(tree, mute=True)
    tree.nodes.remove(output_of(tree))


def outputs_at_both(tree: Any) -> None:
    output_within(tree)
    shine(tree)


def for_cycles_within(tree: Any) -> None:
    output_within(tree, target="CYCLES")
    shine(tree)


IN_ANY_TREE = [
    *((setup, OWN) for setup in (color, number, texture, unfed_gamma, behind_a_reroute, muted_link)),
    *((setup, OWN) for setup in (shader_into_a_color, mixed, muted_output, outputs_at_both)),
    *((setup, OTHER) for setup in (within_a_group, before_a_group, passed_through, color_into_surface)),
    *((setup, OTHER) for setup in (output_only_within, for_cycles_within)),
    *((setup, BLACK) for setup in (muted_emission, no_output, other_engine, output_in_a_muted_group)),
]
NAMED = (no_output, other_engine, output_in_a_muted_group)
trees = pytest.mark.parametrize(("setup", "right"), IN_ANY_TREE, ids=lambda value: getattr(value, "__name__", ""))


@trees
def test_surfaces(setup: Callable[[Any], None], right: tuple[float, float, float], material: Any) -> None:
    setup(material.node_tree)
    scene = read()
    (record,) = scene.materials
    assert record.emission == pytest.approx(right)
    assert record.base_color == BLACK
    assert named(scene, "material") == ["a tree without an output for Cycles is unsupported; black is used"] * (
        setup in NAMED
    )


@trees
def test_lights(setup: Callable[[Any], None], right: tuple[float, float, float], material: Any) -> None:
    light = bpy.data.lights.new("Sun", "SUN")
    light.use_nodes, light.energy = True, 1.0
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Sun", light))
    setup(light.node_tree)
    scene = read()
    assert scene.lights.powers[0].tolist() == pytest.approx(right)
    text = "a tree without an output for Cycles is unsupported; no light is emitted"
    assert named(scene, "light") == [text] * (setup in NAMED)


@trees
def test_worlds(setup: Callable[[Any], None], right: tuple[float, float, float], material: Any) -> None:
    world = bpy.context.scene.world = bpy.data.worlds.new("World")
    world.use_nodes = True
    world.color = (0.1, 0.9, 0.1)
    setup(world.node_tree)
    scene = read()
    assert scene.world.color == pytest.approx(right)
    assert named(scene, "world") == ["a tree without an output for Cycles is unsupported; black is used"] * (
        setup in NAMED
    )


def test_a_muted_surface_over_a_volume_is_none(material: Any) -> None:
    tree = material.node_tree
    muted_emission(tree)
    feed(tree, "ShaderNodeVolumeAbsorption", output_of(tree).inputs["Volume"], mute=False)
    assert read().materials[0].alpha == 0.0


def test_a_muted_volume_is_none(material: Any) -> None:
    tree = material.node_tree
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    feed(tree, "ShaderNodeVolumeAbsorption", output_of(tree).inputs["Volume"])
    assert read().materials[0].alpha == 1.0


@pytest.mark.parametrize(("output", "right"), [(0, OWN), (1, BLACK)])
def test_nodes_of_other_engines_do_not_count_and_are_named(
    output: int, right: tuple[float, float, float], material: Any, foreign: str
) -> None:
    tree = material.node_tree
    feed(tree, foreign, output_of(tree).inputs[0] if output else shine(tree).inputs["Color"], output, mute=False)
    scene = read()
    assert scene.materials[0].emission == pytest.approx(right)
    assert named(scene, "material") == ["Foreign is unsupported; it is ignored, as in Cycles"]
