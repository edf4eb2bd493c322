"""Unsupported features of objects, images, the world, lights and the scene's settings are named."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import pytest
from blender.builders import evaluated, in_render
from blender.named_rows import SHADING, into_color, link, rows, sentences, thick
from blender.node_setups import add, image_node, new_red, shader, surface
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.extract.scene import ReadCache
from perfect_bvh_addon.sync.not_shown import summarize, without_looks

# Objects and images --------------------------------------------------------------------------------------------------


def test_an_object_of_which_nothing_is_shown_is_named(material: Any) -> None:
    tree = material.node_tree
    tree.links.remove(surface(material).links[0])
    thick(material)
    assert sentences() == [
        "Cube: its material has a volume but no surface, so the object is invisible",
        "Red: Volume Scatter is unsupported; nothing is shown",
    ]
    bpy.data.objects["Cube"].data.materials.append(new_red("Shell"))  # in a slot that no face uses
    assert [row.kind for row in rows()] == ["material"]


def test_objects_without_triangles_are_named_in_every_mode(material: Any) -> None:
    bpy.ops.object.volume_add()
    name = bpy.context.object.name
    for attributes in (None, SHADING):
        (row,) = read_scene(evaluated(), attributes).not_shown
        assert (row.kind, row.name, row.session_uid) == ("object", name, bpy.context.object.session_uid)
        assert str(row) in read_scene(evaluated(), attributes).warnings
        assert row.what_to_do == "Add a mesh with a Volume to Mesh modifier that names this volume"


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
        assert str(row) == "Cube: its adaptive subdivision is unsupported; the modifier's levels are used"
        assert without_looks([row]) == (row,)
        assert summarize([row]) == "1 object simplified"
    modifier.show_viewport = False
    assert sentences() == []
    modifier.show_viewport = True
    cube.modifiers.new("Weld", "WELD")
    assert sentences() == [], "another modifier comes after it"


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
        "Red: the UV map Nowhere is not found on Cube; one pixel of the image is used",
        "Red: the attribute Gone is not found on Cube; black is used",
    ]


def test_an_image_that_is_not_there_is_named(material: Any) -> None:
    image = material.node_tree.nodes.new("ShaderNodeTexImage")
    image.image = bpy.data.images.new("gone", 1, 1)
    image.image.source, image.image.filepath = "FILE", "//nowhere.png"
    link(material, image.outputs["Color"])
    (row,) = rows()
    assert (row.kind, row.session_uid) == ("image", image.image.session_uid)
    assert str(row) == "gone: it could not be loaded from '//nowhere.png'; magenta is used"
    assert read_scene(evaluated(), SHADING).warnings == (str(row),)


# The world -----------------------------------------------------------------------------------------------------------


def new_world() -> Any:
    world = bpy.context.scene.world
    if not world.node_tree:
        world.use_nodes = True
    return world.node_tree


@pytest.mark.parametrize(
    ("kind", "socket", "told"),
    [
        ("AmbientOcclusion", "Color", "Ambient Occlusion is unsupported; its flat colour is used"),
        ("AmbientOcclusion", "Strength", "Ambient Occlusion is unsupported; Strength 1 is used"),
        ("TexSky", "Color", None),
        ("LightPath", "Strength", None),  # the output Is Camera Ray
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
    assert sentences() == []  # then the nodes are baked to an image
    tree.links.new(add(tree, "VolumeScatter").outputs[0], tree.get_output_node("ALL").inputs["Volume"])
    world.cycles_visibility.glossy = False
    world.update_tag()
    assert sentences()[:2] == [
        "World: Volume Scatter is unsupported; clear air is used",
        "World: its ray visibility is unsupported; all rays see it",
    ]


# Lights --------------------------------------------------------------------------------------------------------------


def lamp(kind: str = "POINT") -> Any:
    obj = bpy.data.objects.new("Lamp", bpy.data.lights.new("Light", kind))
    bpy.context.scene.collection.objects.link(obj)
    obj.data.use_nodes = True
    return obj


def patterned(obj: Any) -> str:
    tree = obj.data.node_tree
    emission = next(node for node in tree.nodes if node.type == "EMISSION")
    tree.links.new(add(tree, "TexIES").outputs[0], emission.inputs["Strength"])
    return "IES Texture is unsupported; Strength 1 is used"


def pictured(obj: Any) -> str:
    tree = obj.data.node_tree
    emission = next(node for node in tree.nodes if node.type == "EMISSION")
    tree.links.new(image_node(tree).outputs[0], emission.inputs["Color"])
    return "Four as Color is unsupported; its mean is used"


def linked_to_few(obj: Any) -> str:
    obj.light_linking.receiver_collection = bpy.data.collections.new("Few")
    return "its light linking is unsupported; it lights everything"


def unseen_by_mirrors(obj: Any) -> str:
    obj.visible_glossy = False
    return "its ray visibility is unsupported; it lights everything"


def portal(obj: Any) -> str:
    obj.data.type = "AREA"
    bpy.data.lights["Light"].cycles.is_portal = True
    return "Portal is unsupported; a lamp is used"


def fading_otherwise(obj: Any) -> str:
    tree = obj.data.node_tree
    emission = next(node for node in tree.nodes if node.type == "EMISSION")
    tree.links.new(add(tree, "LightFalloff", Strength=2.0).outputs["Constant"], emission.inputs["Strength"])
    return "Light Falloff is unsupported; a quadratic falloff is used"


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
        assert str(row) == "Cube: its light linking is unsupported; it lights everything"
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
    assert sentences() == ["Empty: its light linking is unsupported; it lights everything"]


# Settings ------------------------------------------------------------------------------------------------------------


def test_settings_that_are_ignored_are_named(material: Any) -> None:
    scene, layer = bpy.context.scene, bpy.context.view_layer
    assert sentences() == []
    scene.render.use_motion_blur = True
    assert sentences() == []  # in viewports
    assert list(map(str, in_render(read_scene).not_shown)) == [
        "Motion Blur: it is unsupported here; a single moment is used"
    ]
    layer.use_motion_blur = False
    assert sentences() == []
    scene.render.use_motion_blur = False
    layer.use_sky, scene.cycles.film_exposure, scene.cycles.use_fast_gi = False, 2.0, True
    layer.use_pass_mist = True
    layer.aovs.add().name = "Mask"
    told = sentences()
    assert told == [
        "View Layer ViewLayer: the filter Environment is ignored, as if it was on",
        "Film: the exposure 2 is ignored; 1 is used",
        "Fast GI Approximation: it is unsupported; traced light is used",
    ]
    assert sentences(for_viewport=False) == [*told, "View Layer ViewLayer: passes are not written: Mist, AOV Mask"]


def test_a_second_reading_that_reads_no_materials_names_the_same(material: Any) -> None:
    into_color(material)
    obj = lamp()
    unseen_by_mirrors(obj)
    cache = ReadCache()
    first = rows(cache=cache)
    bpy.context.object.location.x += 1.0
    assert rows(cache=cache) == first == [*rows()]
    assert len(first) == 2
