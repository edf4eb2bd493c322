"""Nothing is dropped in silence: what the image shows otherwise than Blender's nodes and settings say is named."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import pytest
from blender.builders import evaluated
from blender.node_setups import SETUPS, add, image_node, new_red, one_sided, paint, shader, surface
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.extract.looks.shown_nodes import IGNORED_INPUTS, SHOWN_NODES, SIMPLIFIED_NODES
from perfect_bvh_addon.sync.not_shown import NotShown, summarize, without_looks
from perfect_bvh_addon.sync.records import AttributeRequest

SHADING = AttributeRequest(shading=True)
# Nodes of which the output, or what they are given, decides.
SHOWN_AT_TIMES = {
    "TEX_COORD",
    "OBJECT_INFO",
    "ATTRIBUTE",
    "VERTEX_COLOR",
    "LIGHT_FALLOFF",
    "TEX_SKY",
    "TEX_IMAGE",
    "TEX_ENVIRONMENT",
}


@pytest.fixture
def material() -> Any:
    """Of an object with a UV map and colours, under a plain world."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.world = bpy.data.worlds.new("World")
    bpy.ops.mesh.primitive_cube_add()
    material = new_red()
    bpy.context.object.data.materials.append(material)
    paint(bpy.context.object.data)
    return material


def rows(**options: Any) -> list[NotShown]:
    return list(read_scene(evaluated(), SHADING, **options).not_shown)


def sentences(**options: Any) -> list[str]:
    return list(map(str, rows(**options)))


def link(material: Any, output: Any, name: str = "Base Color") -> None:
    material.node_tree.links.new(output, shader(material).inputs[name])


# Every node -------------------------------------------------------------------------------------------------------


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
    """Link a node's output to what it is made for."""
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


@pytest.mark.parametrize("setup", SETUPS, ids=lambda setup: setup.__name__)
def test_what_is_shown_is_not_named(setup: Callable[[Any], None], material: Any) -> None:
    setup(material)
    expected = ["Red: Geometry Backfacing is not shown; its front is, on both sides"] if setup is one_sided else []
    assert sentences() == expected


def test_the_table_names_inputs_that_blender_has(material: Any) -> None:
    found = {}
    for identifier in node_types():
        node = material.node_tree.nodes.new(identifier)
        found[node.type] = {socket.identifier for socket in node.inputs}
    for kind, inputs in IGNORED_INPUTS.items():
        if bpy.app.version >= (5, 0, 0):
            assert {ignored.identifier for ignored in inputs} <= found[kind], kind


def test_the_readme_lists_the_nodes_that_are_not_shown(material: Any, repository: Path) -> None:
    text = " ".join((repository / "README.md").read_text(encoding="utf-8").split())
    listed = set(text.split("Nodes that are not shown as they are: ")[1].split(". ")[0].split(", "))
    nodes = [material.node_tree.nodes.new(identifier) for identifier in node_types()]
    names = {node.bl_label for node in nodes if node.type not in SHOWN_NODES}
    shown = {node.bl_label for node in nodes} - names
    assert not listed & shown
    if bpy.app.version[:2] == (5, 0):  # others lack some, or have more
        assert listed == names
    for ignored in IGNORED_INPUTS["BSDF_PRINCIPLED"]:
        assert ignored.name.lower().replace("anisotropic", "anisotropy") in text.lower()


# What is shown instead --------------------------------------------------------------------------------------------


def noise(material: Any) -> Any:
    return add(material.node_tree, "TexNoise")


def into_color(material: Any) -> None:
    link(material, noise(material).outputs["Color"])


def into_roughness(material: Any) -> None:
    link(material, noise(material).outputs[0], "Roughness")


def into_alpha(material: Any) -> None:
    link(material, noise(material).outputs[0], "Alpha")


def into_strength(material: Any) -> None:
    link(material, noise(material).outputs[0], "Emission Strength")


def into_a_mix(material: Any) -> None:
    tree = material.node_tree
    mix = add(tree, "MixShader", (noise(material).outputs[0], 0), (shader(material).outputs[0], 1))
    tree.links.new(add(tree, "BsdfDiffuse").outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], surface(material))


def into_two_inputs(material: Any) -> None:
    node = noise(material)
    link(material, node.outputs["Color"])
    link(material, node.outputs[0], "Roughness")


def behind_a_group(material: Any) -> None:
    group = bpy.data.node_groups.new("Dirt", "ShaderNodeTree")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    out = group.nodes.new("NodeGroupOutput")
    group.links.new(add(group, "TexNoise").outputs["Color"], out.inputs[0])
    node = material.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    link(material, node.outputs[0])


def labelled(material: Any) -> None:
    node = noise(material)
    node.label = "Dirt"
    link(material, node.outputs["Color"])


def map_of_roughness(material: Any) -> None:
    link(material, image_node(material.node_tree).outputs[0], "Roughness")


def two_images(material: Any) -> None:
    tree = material.node_tree
    other = tree.nodes.new("ShaderNodeTexImage")
    other.image = bpy.data.images.new("Other", 2, 2)
    mix = add(tree, "MixRGB", (image_node(tree).outputs[0], 1), (other.outputs[0], 2), Fac=0.5)
    link(material, mix.outputs[0])


def colors_in_a_mix(material: Any) -> None:
    tree = material.node_tree
    attribute = add(tree, "VertexColor")
    attribute.layer_name = "Paint"
    link(material, add(tree, "Invert", (attribute.outputs[0], 1)).outputs[0])


def generated_coordinates(material: Any) -> None:
    tree = material.node_tree
    image = image_node(tree)
    tree.links.new(add(tree, "TexCoord").outputs["Generated"], image.inputs[0])
    link(material, image.outputs[0])


def on_a_box(material: Any) -> None:
    image = image_node(material.node_tree)
    image.projection, image.interpolation, image.extension = "BOX", "Closest", "MIRROR"
    link(material, image.outputs[0])


def bumpy(material: Any) -> None:
    tree = material.node_tree
    link(material, add(tree, "Bump", (noise(material).outputs[0], 2)).outputs[0], "Normal")


def coated(material: Any) -> None:
    inputs = shader(material).inputs
    for name in ("Subsurface Weight", "Coat Weight", "Sheen Weight", "Anisotropic", "Thin Film Thickness"):
        inputs[name].default_value = 0.5


def coated_by_a_node(material: Any) -> None:
    link(material, noise(material).outputs[0], "Coat Weight")


def not_coated_by_a_node(material: Any) -> None:
    value = add(material.node_tree, "Value")
    value.outputs[0].default_value = 0.0
    link(material, value.outputs[0], "Coat Weight")


def thick(material: Any) -> None:
    tree = material.node_tree
    tree.links.new(add(tree, "VolumeScatter").outputs[0], tree.get_output_node("ALL").inputs["Volume"])


def never_seen(material: Any) -> None:
    """What a mix takes nothing of."""
    tree = material.node_tree
    toon = add(tree, "BsdfToon", (noise(material).outputs["Color"], 0))
    mix = add(tree, "MixShader", (shader(material).outputs[0], 1), (toon.outputs[0], 2), Fac=0.0)
    tree.links.new(mix.outputs[0], surface(material))


def tinted_nothing(material: Any) -> None:
    tree = material.node_tree
    tree.links.new(add(tree, "BsdfTransparent", Color=(1.0, 0.2, 0.2, 1.0)).outputs[0], surface(material))


NOISE = "Noise Texture is not shown;"
INSTEAD: tuple[tuple[Callable[[Any], None], list[str]], ...] = (
    (into_color, [f"{NOISE} its flat colour is"]),
    (into_roughness, [f"{NOISE} Roughness 0.5 is"]),
    (into_alpha, [f"{NOISE} all of the surface is"]),
    (into_strength, [f"{NOISE} no light of its own is"]),
    (into_a_mix, [f"{NOISE} half of each is"]),
    (into_two_inputs, [f"{NOISE} its flat colour is"]),
    (behind_a_group, [f"{NOISE} its flat colour is"]),
    (labelled, ["Dirt (Noise Texture) is not shown; its flat colour is"]),
    (map_of_roughness, ["Four as Roughness is not shown; Roughness 0.33 is"]),
    (two_images, ["Other, a second image, is not shown; its mean is"]),
    (colors_in_a_mix, ["Color Attribute Paint is not shown; its flat colour is"]),
    (generated_coordinates, ["Texture Coordinate Generated is not shown; the UV map is"]),
    (
        on_a_box,
        [
            "the projection Box of Four is not shown; the image is, in the UV map",
            "Closest interpolation of Four is not shown; Linear is",
            "the mirrored extension of Four is not shown; Repeat is",
        ],
    ),
    (bumpy, ["Bump is not shown; the mesh's own normals are"]),
    (
        coated,
        [
            "Subsurface is not shown; a diffuse surface is",
            "Anisotropic is not shown; an even reflection is",
            "Coat is not shown; what it covers is",
            "Sheen is not shown; what it covers is",
            "Thin Film is not shown; what it covers is",
        ],
    ),
    (coated_by_a_node, ["Coat is not shown; what it covers is"]),
    (not_coated_by_a_node, []),
    (thick, ["Volume Scatter is not shown; its surface alone is"]),
    (never_seen, []),
    (tinted_nothing, ["Color of the Transparent BSDF is not shown; white is"]),
)


@pytest.mark.parametrize(("setup", "told"), INSTEAD, ids=lambda value: getattr(value, "__name__", ""))
def test_what_is_shown_instead_is_said(setup: Callable[[Any], None], told: list[str], material: Any) -> None:
    setup(material)
    assert sentences() == [f"Red: {text}" for text in told]
    assert all(row.session_uid == material.session_uid for row in rows())


def test_modes_that_show_no_materials_name_none(material: Any) -> None:
    into_color(material)
    assert read_scene(evaluated()).not_shown == ()


# Objects, the world, lights, settings -----------------------------------------------------------------------------


def test_an_object_of_which_nothing_is_shown_is_named(material: Any) -> None:
    tree = material.node_tree
    tree.links.remove(surface(material).links[0])
    thick(material)
    assert sentences() == [
        "Cube: its material has a volume and no surface; nothing of it is shown",
        "Red: Volume Scatter is not shown; nothing is",
    ]
    bpy.data.objects["Cube"].data.materials.append(new_red("Shell"))  # in a slot that no face has
    assert [row.kind for row in rows()] == ["material"]


def test_objects_without_triangles_are_named_in_every_mode(material: Any) -> None:
    bpy.ops.object.volume_add()
    name = bpy.context.object.name
    for attributes in (None, SHADING):
        (row,) = read_scene(evaluated(), attributes).not_shown
        assert (row.kind, row.name, row.session_uid) == ("object", name, bpy.context.object.session_uid)
        assert str(row) in read_scene(evaluated(), attributes).warnings


def test_attributes_and_uv_maps_that_are_not_there_are_named(material: Any) -> None:
    tree = material.node_tree
    attribute = add(tree, "VertexColor")
    attribute.layer_name = "Paint"
    link(material, attribute.outputs[0])
    assert sentences() == []
    attribute.layer_name = "Gone"
    image, uv = image_node(tree), add(tree, "UVMap")
    uv.uv_map = "Nowhere"
    tree.links.new(uv.outputs[0], image.inputs[0])
    link(material, image.outputs[0], "Emission Color")
    shader(material).inputs["Emission Strength"].default_value = 1.0
    assert sentences() == [
        "Red: the UV map Nowhere is not found on Cube; one pixel of the image is",
        "Red: the attribute Gone is not found on Cube; black is",
    ]


def test_an_image_that_is_not_there_is_named(material: Any) -> None:
    image = material.node_tree.nodes.new("ShaderNodeTexImage")
    image.image = bpy.data.images.new("gone", 1, 1)
    image.image.source, image.image.filepath = "FILE", "//nowhere.png"
    link(material, image.outputs["Color"])
    (row,) = rows()
    assert (row.kind, row.session_uid) == ("image", image.image.session_uid)
    assert str(row) == "gone: it could not be loaded from '//nowhere.png'; magenta is shown"
    assert read_scene(evaluated(), SHADING).warnings == (str(row),)


def new_world() -> Any:
    world = bpy.context.scene.world
    if not world.node_tree:
        world.use_nodes = True
    return world.node_tree


@pytest.mark.parametrize(
    ("kind", "socket", "told"),
    [
        ("TexNoise", "Color", "Noise Texture is not shown; its flat colour is"),
        ("TexNoise", "Strength", "Noise Texture is not shown; Strength 1 is"),
        ("TexSky", "Color", None),
        ("LightPath", "Strength", None),  # whether the camera looks
    ],
)
def test_what_of_the_world_is_not_shown(kind: str, socket: str, told: str | None, material: Any) -> None:
    tree = new_world()
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    tree.links.new(add(tree, kind).outputs[0], background.inputs[socket])
    assert sentences() == ([] if told is None else [f"World: {told}"])
    assert all((row.kind, row.session_uid) == ("world", bpy.context.scene.world.session_uid) for row in rows())


def test_the_worlds_volume_mapping_and_visibility(material: Any) -> None:
    tree, world = new_world(), bpy.context.scene.world
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    environment = tree.nodes.new("ShaderNodeTexEnvironment")
    environment.image = bpy.data.images.new("Sky", 8, 4)
    mapping = add(tree, "Mapping", (add(tree, "TexCoord").outputs["Generated"], 0), Rotation=(0.0, 0.0, 1.0))
    tree.links.new(mapping.outputs[0], environment.inputs[0])
    tree.links.new(environment.outputs[0], background.inputs["Color"])
    assert sentences() == []
    mapping.inputs["Rotation"].default_value = (0.7, 0.0, 0.0)
    assert sentences() == ["World: the Mapping of Sky is not shown; its turn about the vertical is"]
    tree.links.new(add(tree, "VolumeScatter").outputs[0], tree.get_output_node("ALL").inputs["Volume"])
    world.cycles_visibility.glossy = False
    world.update_tag()
    assert sentences()[:2] == [
        "World: Volume Scatter is not shown; clear air is",
        "World: its ray visibility is not shown; all rays see it",
    ]


def lamp(kind: str = "POINT") -> Any:
    obj = bpy.data.objects.new("Lamp", bpy.data.lights.new("Light", kind))
    bpy.context.scene.collection.objects.link(obj)
    obj.data.use_nodes = True
    return obj


def patterned(obj: Any) -> str:
    tree = obj.data.node_tree
    emission = next(node for node in tree.nodes if node.type == "EMISSION")
    tree.links.new(add(tree, "TexIES").outputs[0], emission.inputs["Strength"])
    return "IES Texture is not shown; Strength 1 is"


def pictured(obj: Any) -> str:
    tree = obj.data.node_tree
    emission = next(node for node in tree.nodes if node.type == "EMISSION")
    tree.links.new(image_node(tree).outputs[0], emission.inputs["Color"])
    return "Four as Color is not shown; its mean is"


def linked_to_few(obj: Any) -> str:
    obj.light_linking.receiver_collection = bpy.data.collections.new("Few")
    return "its light linking is not shown; it lights everything"


def unseen_by_mirrors(obj: Any) -> str:
    obj.visible_glossy = False
    return "its ray visibility is not shown; it lights everything"


def portal(obj: Any) -> str:
    obj.data.type = "AREA"
    bpy.data.lights["Light"].cycles.is_portal = True
    return "Portal is not shown; a lamp is"


def fading_otherwise(obj: Any) -> str:
    tree = obj.data.node_tree
    emission = next(node for node in tree.nodes if node.type == "EMISSION")
    tree.links.new(add(tree, "LightFalloff", Strength=2.0).outputs["Constant"], emission.inputs["Strength"])
    return "Light Falloff is not shown; Strength 2 is"


@pytest.mark.parametrize(
    "setup",
    [patterned, pictured, linked_to_few, unseen_by_mirrors, portal, fading_otherwise],
    ids=lambda it: it.__name__,
)
def test_what_of_a_light_is_not_shown(setup: Callable[[Any], str], material: Any) -> None:
    obj = lamp()
    assert sentences() == []
    told = setup(obj)
    assert sentences() == [f"Light: {told}"]
    (row,) = rows()
    assert (row.kind, row.session_uid) == ("light", bpy.data.lights["Light"].session_uid)
    twin = bpy.data.objects.new("Twin", obj.data)
    bpy.context.scene.collection.objects.link(twin)
    assert len(sentences()) == 1


def test_light_linking_of_what_shines_is_named(material: Any) -> None:
    cube = bpy.context.object
    cube.light_linking.receiver_collection = bpy.data.collections.new("Few")
    assert sentences() == [], "it lights nothing"
    inputs = shader(material).inputs
    inputs["Emission Color"].default_value, inputs["Emission Strength"].default_value = (1.0, 1.0, 1.0, 1.0), 2.0
    for linking in ("receiver_collection", "blocker_collection"):
        cube.light_linking.receiver_collection = cube.light_linking.blocker_collection = None
        assert sentences() == []
        setattr(cube.light_linking, linking, bpy.data.collections["Few"])
        (row,) = rows()
        assert (row.kind, row.session_uid) == ("light", cube.session_uid)
        assert str(row) == "Cube: its light linking is not shown; it lights everything"
    assert read_scene(evaluated()).not_shown == (), "nothing shines in this mode"


def test_light_linking_of_what_instances_what_shines_is_named(material: Any) -> None:
    inputs = shader(material).inputs
    inputs["Emission Color"].default_value, inputs["Emission Strength"].default_value = (1.0, 1.0, 1.0, 1.0), 2.0
    collection = bpy.data.collections.new("Shining")
    collection.objects.link(bpy.context.object)
    empty = bpy.data.objects.new("Empty", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    bpy.context.scene.collection.objects.link(empty)
    assert sentences() == []
    empty.light_linking.receiver_collection = bpy.data.collections.new("Few")
    assert sentences() == ["Empty: its light linking is not shown; it lights everything"]


def test_adaptive_subdivision_is_named_in_every_mode(material: Any) -> None:
    cube = bpy.context.object
    modifier = cube.modifiers.new("Subdivision", "SUBSURF")
    assert sentences() == []
    if bpy.app.version >= (5, 0, 0):
        modifier.use_adaptive_subdivision = True
    else:
        cube.cycles.use_adaptive_subdivision = True
        cube.update_tag()
        assert sentences() == []
        bpy.context.scene.cycles.feature_set = "EXPERIMENTAL"
    for attributes in (None, SHADING):
        (row,) = read_scene(evaluated(), attributes).not_shown
        assert (row.kind, row.session_uid) == ("shape", cube.session_uid)
        assert str(row) == "Cube: its adaptive subdivision is not shown; the modifier's levels are"
        assert without_looks([row]) == (row,)
        assert summarize([row]) == "1 object simplified"
    modifier.show_viewport = False
    assert sentences() == []
    modifier.show_viewport = True
    cube.modifiers.new("Weld", "WELD")
    assert sentences() == [], "another modifier comes after it"


def test_settings_that_are_ignored_are_named(material: Any) -> None:
    scene, layer = bpy.context.scene, bpy.context.view_layer
    assert sentences() == []
    scene.render.use_motion_blur = True
    assert list(map(str, read_scene(evaluated()).not_shown)) == ["Motion Blur: it is not shown; one moment is"]
    layer.use_motion_blur = False
    assert sentences() == []
    scene.render.use_motion_blur = False
    layer.use_sky, scene.cycles.film_exposure, scene.cycles.use_fast_gi = False, 2.0, True
    layer.use_pass_mist = True
    layer.aovs.add().name = "Mask"
    told = sentences()
    assert told == [
        "View Layer ViewLayer: the filter Environment is not asked; environment stays shown",
        "Film: the exposure 2 is not asked; 1 is",
        "Fast GI Approximation: it is not shown; traced light is",
    ]
    assert sentences(for_viewport=False) == [*told, "View Layer ViewLayer: passes are not written: Mist, AOV Mask"]


def test_a_second_reading_that_reads_no_materials_names_the_same(material: Any) -> None:
    from perfect_bvh_addon.extract.scene import ReadCache

    into_color(material)
    obj = lamp()
    unseen_by_mirrors(obj)
    cache = ReadCache()
    first = rows(cache=cache)
    bpy.context.object.location.x += 1.0
    assert rows(cache=cache) == first == [*rows()]
    assert len(first) == 2
