"""The look of a scene under its own light: materials' nodes, images, lights and the world."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import (
    SQUARE,
    NodeGroup,
    collection,
    collection_instance,
    evaluated,
    in_render,
    instances_on_grid,
    mesh_data,
    mesh_object,
    object_info,
)
from blender.program_slots import slots_of
from mathutils import Matrix
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.extract.scene import ReadCache
from perfect_bvh_addon.sync.look_records import ImageRecord, MaterialRecord
from perfect_bvh_addon.sync.records import AttributeRequest, SceneRecord

SHADING = AttributeRequest(shading=True)


@pytest.fixture(autouse=True)
def empty_scene() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)


def read(cache: ReadCache | None = None) -> SceneRecord:
    return read_scene(evaluated(), SHADING, cache=cache)


def new_material(name: str = "material") -> Any:
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    obj = mesh_object(f"{name} object")
    obj.data.materials.append(material)
    return material


def principled(material: Any) -> Any:
    return next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")


def add_node(material: Any, kind: str, **inputs: Any) -> Any:
    node = material.node_tree.nodes.new(kind)
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    return node


def link(material: Any, output: Any, socket: Any) -> None:
    material.node_tree.links.new(output, socket)


def new_image(name: str = "image", color=(0.5, 0.25, 1.0, 1.0), size=(4, 2), **options: Any) -> Any:
    image = bpy.data.images.new(name, *size, alpha=True, **options)
    image.pixels.foreach_set(np.tile(np.float32(color), size[0] * size[1]))
    return image


def only_material() -> MaterialRecord:
    (material,) = read().materials
    return material


# Materials -----------------------------------------------------------------------------------------------------------


def test_principled_values() -> None:
    node = principled(new_material())
    node.inputs["Base Color"].default_value = (0.1, 0.2, 0.3, 1.0)
    node.inputs["Emission Color"].default_value = (1.0, 0.5, 0.0, 1.0)
    node.inputs["Emission Strength"].default_value = 4.0
    node.inputs["Alpha"].default_value = 0.25
    material = only_material()
    assert material.base_color == pytest.approx((0.1, 0.2, 0.3))
    assert material.emission == pytest.approx((4.0, 2.0, 0.0))
    assert material.alpha == pytest.approx(0.25)
    assert material.program is None
    assert gloss_of(material) == pytest.approx((0.0, 0.5, 0.04, 0.0))
    for name, value in {"Metallic": 0.3, "Roughness": 0.2, "IOR": 2.0, "Transmission Weight": 0.6}.items():
        node.inputs[name].default_value = value
    node.inputs["Specular IOR Level"].default_value = 0.25
    assert gloss_of(only_material()) == pytest.approx((0.3, 0.2, 0.5 / 9.0, 0.6))


def gloss_of(material: MaterialRecord) -> tuple[float, float, float, float]:
    return material.metallic, material.roughness, material.reflectance, material.transmission


@pytest.mark.parametrize(
    ("kind", "inputs", "expected"),
    [
        ("ShaderNodeBsdfDiffuse", {"Roughness": 0.3}, (0.0, 1.0, 0.0, 0.0)),
        ("ShaderNodeBsdfAnisotropic", {"Roughness": 0.3}, (1.0, 0.3, 0.0, 0.0)),
        ("ShaderNodeBsdfGlass", {"Roughness": 0.1, "IOR": 2.0}, (0.0, 0.1, 1.0 / 9.0, 1.0)),
        ("ShaderNodeBsdfRefraction", {"Roughness": 0.1}, (0.0, 0.1, 0.0, 1.0)),
        ("ShaderNodeBsdfTranslucent", {}, (0.0, 1.0, 0.0, 0.0)),
    ],
)
def test_simple_shaders_shine_as_their_names_say(kind: str, inputs: dict[str, float], expected) -> None:
    material = new_material()
    shader = add_node(material, kind, Color=(0.2, 0.4, 0.6, 1.0), **inputs)
    link(material, shader.outputs[0], material.node_tree.get_output_node("ALL").inputs["Surface"])
    record = only_material()
    assert gloss_of(record) == pytest.approx(expected)
    assert record.base_color == pytest.approx((0.2, 0.4, 0.6))


def test_a_mix_of_two_shaders_shines_in_between() -> None:
    material = new_material()
    mix = add_node(material, "ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.25
    link(material, add_node(material, "ShaderNodeBsdfDiffuse").outputs[0], mix.inputs[1])
    link(material, add_node(material, "ShaderNodeBsdfAnisotropic", Roughness=0.2).outputs[0], mix.inputs[2])
    link(material, mix.outputs[0], material.node_tree.get_output_node("ALL").inputs["Surface"])
    assert gloss_of(only_material()) == pytest.approx((0.25, 0.2, 0.0, 0.0))  # diffuse reflection has no roughness


def test_an_image_behind_a_reroute_and_a_correction() -> None:
    material = new_material()
    texture, correction = add_node(material, "ShaderNodeTexImage"), add_node(material, "ShaderNodeHueSaturation")
    reroute = add_node(material, "NodeReroute")
    texture.image, texture.extension = new_image(), "CLIP"
    link(material, texture.outputs["Color"], reroute.inputs[0])
    link(material, reroute.outputs[0], correction.inputs["Color"])
    link(material, correction.outputs["Color"], principled(material).inputs["Base Color"])
    link(material, texture.outputs["Alpha"], principled(material).inputs["Alpha"])
    record = read()
    assert set(slots_of(record.materials[0].program)) == {"COLOR", "ALPHA"}
    (image,) = record.images
    assert image.extension == "clip"
    assert image.pixels.shape == (2, 4, 4)
    assert image.pixels.dtype == np.uint8
    assert image.pixels[0, 0].tolist() == [128, 64, 255, 255]


def test_float_images_are_linear_with_straight_alpha() -> None:
    material = new_material()
    texture = add_node(material, "ShaderNodeTexImage")
    texture.image = new_image(color=(4.0, 0.5, 0.25, 0.5), float_buffer=True)
    link(material, texture.outputs["Color"], principled(material).inputs["Base Color"])
    (image,) = read().images
    assert image.pixels.dtype == np.float32
    assert image.pixels[1, 3] == pytest.approx((8.0, 1.0, 0.5, 0.5))


def shown_image(image: Any) -> ImageRecord:
    material = new_material()
    texture = add_node(material, "ShaderNodeTexImage")
    texture.image = image
    link(material, texture.outputs["Color"], principled(material).inputs["Base Color"])
    (record,) = read().images
    return record


def test_bytes_that_are_data_stay_bytes() -> None:
    """Each value of a byte is converted to Blender's own value."""
    image = bpy.data.images.new("data", 16, 16, is_data=True)
    image.pixels.foreach_set(np.repeat(np.arange(256, dtype=np.float32) / 255.0, 4))
    record = shown_image(image)
    values = np.empty(1024, np.float32)
    image.pixels.foreach_get(values)
    assert record.is_linear and record.pixels.dtype == np.uint8
    np.testing.assert_array_equal(record.pixels.ravel() * np.float32(1.0 / 255.0), values)
    assert record.byte_count == values.nbytes // 4


def test_a_missing_image_is_magenta_and_named() -> None:
    material = new_material()
    texture = add_node(material, "ShaderNodeTexImage")
    texture.image = bpy.data.images.new("gone", 1, 1)
    texture.image.source, texture.image.filepath = "FILE", "//nowhere.png"
    link(material, texture.outputs["Color"], principled(material).inputs["Base Color"])
    record = read()
    assert record.images[0].pixels.tolist() == [[[255, 0, 255, 255]]]
    assert any("gone" in warning and "nowhere.png" in warning for warning in record.warnings)


def test_mixed_shaders() -> None:
    material = new_material()
    output = material.node_tree.get_output_node("ALL")
    mix = add_node(material, "ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.25
    diffuse = add_node(material, "ShaderNodeBsdfDiffuse", Color=(0.2, 0.4, 0.6, 1.0))
    link(material, diffuse.outputs[0], mix.inputs[1])
    link(material, add_node(material, "ShaderNodeBsdfTransparent").outputs[0], mix.inputs[2])
    link(material, mix.outputs[0], output.inputs["Surface"])
    record = only_material()
    assert record.alpha == pytest.approx(0.75)
    assert record.base_color == pytest.approx((0.2, 0.4, 0.6))
    emission = add_node(material, "ShaderNodeEmission", Color=(1.0, 1.0, 0.0, 1.0), Strength=2.0)
    link(material, emission.outputs[0], mix.inputs[2])
    assert only_material().emission == pytest.approx((0.5, 0.5, 0.0))


def test_what_is_not_followed_takes_the_viewport_color() -> None:
    material = new_material()
    material.diffuse_color = (0.3, 0.6, 0.9, 1.0)
    noise = add_node(material, "ShaderNodeAmbientOcclusion")
    link(material, noise.outputs["Color"], principled(material).inputs["Base Color"])
    assert only_material().base_color == pytest.approx((0.3, 0.6, 0.9))


def test_a_loop_of_nodes_ends() -> None:
    material = new_material()
    first, second = (add_node(material, "ShaderNodeGamma") for _ in range(2))
    link(material, first.outputs[0], second.inputs["Color"])
    link(material, second.outputs[0], first.inputs["Color"])
    link(material, first.outputs[0], principled(material).inputs["Base Color"])
    assert len(only_material().base_color) == 3


def test_branches_that_meet_again_and_again_take_no_time() -> None:
    """60 mixes, each of the previous one with itself: there are 2 to the power of 60 paths through them."""
    material = new_material()
    last = add_node(material, "ShaderNodeRGB")
    for _ in range(60):
        mix = add_node(material, "ShaderNodeMixRGB")
        for name in ("Color1", "Color2"):
            link(material, last.outputs[0], mix.inputs[name])
        last = mix
    link(material, last.outputs[0], principled(material).inputs["Base Color"])
    assert len(only_material().base_color) == 3


def test_nothing_is_read_that_was_not_asked_for() -> None:
    material = new_material()
    principled(material).inputs["Base Color"].default_value = (1.0, 0.0, 0.0, 1.0)
    record = read_scene(evaluated())
    assert record.world is None
    assert record.images == ()
    assert record.materials[0].base_color == MaterialRecord("", 0, 0, (0, 0, 0, 0)).base_color


# Images that change --------------------------------------------------------------------------------------------------


def test_an_unchanged_image_is_not_read_again_and_a_painted_one_is(tmp_path: Path) -> None:
    material = new_material()
    texture = add_node(material, "ShaderNodeTexImage")
    texture.image = new_image()
    texture.image.filepath_raw, texture.image.file_format = str(tmp_path / "image.png"), "PNG"
    texture.image.save()
    link(material, texture.outputs["Color"], principled(material).inputs["Base Color"])
    cache = ReadCache()
    first, second = (read(cache).images[0].pixels for _ in range(2))
    assert first is second
    texture.image.pixels.foreach_set(np.zeros(32, np.float32))
    assert not read(cache).images[0].pixels.any()
    texture.image.save()
    assert not read(cache).images[0].pixels.any()


def test_an_edit_of_looks_shows_in_the_next_update() -> None:
    material = new_material()
    bpy.context.scene.world = bpy.data.worlds.new("world")
    light = bpy.data.lights.new("lamp", "POINT")
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("lamp", light))
    sync = SceneSync(SHADING, watch=False)
    sync.update(evaluated())
    assert not sync.update(evaluated()).materials_changed
    node = principled(material)

    def set_color() -> None:
        node.inputs["Base Color"].default_value = (0.9, 0.0, 0.0, 1.0)

    def set_energy() -> None:
        light.energy = 123.0

    def set_world() -> None:
        tree = bpy.context.scene.world.node_tree
        if tree is None:
            bpy.context.scene.world.color = (0.1, 0.2, 0.9)
        else:
            tree.nodes["Background"].inputs["Color"].default_value = (0.1, 0.2, 0.9, 1.0)

    def set_metallic() -> None:
        node.inputs["Metallic"].default_value = 0.75

    def set_roughness() -> None:
        node.inputs["Roughness"].default_value = 0.125

    def move_light() -> None:
        bpy.data.objects["lamp"].location.x = 2.0

    def soften_light() -> None:
        light.shadow_soft_size = 0.5

    edits = (set_color, set_energy, set_world, set_metallic, set_roughness, move_light, soften_light)
    for edit in edits:
        edit()
        assert sync.update(evaluated()).materials_changed, edit.__name__
    look = sync.appearance
    assert look.lights.positions[0].tolist() == [2.0, 0.0, 0.0]
    assert look.materials.base_colors[0] == pytest.approx((0.9, 0.0, 0.0))
    assert look.lights.powers[0] == pytest.approx((123.0,) * 3)
    assert look.world is not None
    assert look.world.color == pytest.approx((0.1, 0.2, 0.9))
    assert (look.materials.metallics[0], look.materials.roughnesses[0]) == (0.75, 0.125)


# Lights --------------------------------------------------------------------------------------------------------------


def new_light(kind: str, matrix: Any = None, **settings: Any) -> Any:
    light = bpy.data.lights.new(kind.lower(), kind)
    for name, value in settings.items():
        setattr(light, name, value)
    obj = bpy.data.objects.new(kind.lower(), light)
    obj.matrix_world = Matrix() if matrix is None else matrix
    bpy.context.scene.collection.objects.link(obj)
    return obj


def test_each_kind_of_light() -> None:
    new_light("POINT", Matrix.Translation((1, 2, 3)), energy=10.0, color=(1.0, 0.5, 0.0), shadow_soft_size=0.25)
    new_light("SUN", energy=3.0, angle=0.1)
    new_light("SPOT", energy=5.0, spot_size=1.0, spot_blend=0.3, use_shadow=False)
    new_light("AREA", Matrix.Diagonal((2, 3, 1, 1)), energy=7.0, shape="RECTANGLE", size=0.5, size_y=0.25)
    new_light("AREA", energy=7.0, shape="DISK", size=0.5)
    lights = read().lights
    by_kind = {kind: row for row, kind in enumerate(lights.kinds)}
    assert sorted(by_kind) == ["ellipse", "point", "rectangle", "spot", "sun"]
    point, sun, spot, rectangle, ellipse = (by_kind[kind] for kind in ("point", "sun", "spot", "rectangle", "ellipse"))
    assert lights.positions[point] == pytest.approx((1, 2, 3))
    assert lights.powers[point] == pytest.approx((10, 5, 0))
    assert lights.sizes[point, 0] == pytest.approx(0.25)
    assert (lights.powers[sun, 0], lights.sizes[sun, 0]) == pytest.approx((3.0, 0.1))
    assert lights.cones[spot] == pytest.approx((1.0, 0.3))
    assert lights.casts_shadow.tolist() == [kind != "spot" for kind in lights.kinds]
    assert lights.sizes[rectangle] == pytest.approx((1.0, 0.75))
    assert lights.axes[rectangle] == pytest.approx(np.eye(3))
    assert lights.sizes[ellipse] == pytest.approx((0.5, 0.5))


def test_a_light_shines_along_its_own_minus_z() -> None:
    new_light("SUN", Matrix.Rotation(math.radians(90), 4, "X"))
    assert read().lights.axes[0, 2] == pytest.approx((0, -1, 0), abs=1e-6)


def test_instanced_and_hidden_lights() -> None:
    members = collection("lamps", linked=False)
    obj = new_light("POINT")
    bpy.context.scene.collection.objects.unlink(obj)
    members.objects.link(obj)
    collection_instance("here", members, location=(5, 0, 0))
    collection_instance("there", members, location=(0, 6, 0))
    new_light("SUN").hide_render = True
    record = in_render(lambda depsgraph: read_scene(depsgraph, SHADING))
    assert record.lights.kinds == ("point", "point")
    assert sorted(record.lights.positions.tolist()) == [[0, 6, 0], [5, 0, 0]]


def shown_by_nodes(lamp: Any) -> None:
    instances_on_grid("field", object_info(lamp))


def shown_by_nodes_of_a_collection(lamp: Any) -> None:
    def lamps(group: NodeGroup) -> Any:
        return group.node("GeometryNodeCollectionInfo", Collection=lamp.users_collection[0]).outputs["Instances"]

    instances_on_grid("field", lamps)


def shown_by_particles(lamp: Any) -> None:
    emitter = mesh_object("emitter", mesh_data("emitter", *SQUARE))
    settings = emitter.modifiers.new("particles", "PARTICLE_SYSTEM").particle_system.settings
    settings.count, settings.frame_end, settings.physics_type = 4, 1.0, "NO"
    settings.render_type, settings.instance_object = "OBJECT", lamp


def shown_by_vertices(lamp: Any) -> None:
    parent = mesh_object("parent", mesh_data("parent", *SQUARE))
    lamp.parent, parent.instance_type = parent, "VERTS"


@pytest.mark.parametrize(
    "show",
    [shown_by_nodes, shown_by_nodes_of_a_collection, shown_by_particles, shown_by_vertices],
    ids=lambda show: show.__name__,
)
def test_lights_are_where_whatever_instances_them_has_them(show: Any) -> None:
    lamps = collection("lamps", linked=show is not shown_by_nodes_of_a_collection)
    lamp = new_light("POINT")
    bpy.context.scene.collection.objects.unlink(lamp)
    lamps.objects.link(lamp)
    show(lamp)
    bpy.context.scene.frame_set(2)
    listed = [
        np.array(entry.matrix_world)[:3, 3].tolist()
        for entry in evaluated().object_instances
        if entry.object.type == "LIGHT"
    ]
    assert len(listed) >= 4
    assert sorted(read().lights.positions.tolist()) == sorted(listed)


# World ---------------------------------------------------------------------------------------------------------------


def new_world() -> Any:
    world = bpy.context.scene.world = bpy.data.worlds.new("world")
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    return world


def test_a_scene_without_a_world_is_dark() -> None:
    assert read().world.color == (0.0, 0.0, 0.0)


def test_background_color_and_strength() -> None:
    background = new_world().node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (0.1, 0.2, 0.4, 1.0)
    background.inputs["Strength"].default_value = 2.0
    assert read().world.color == pytest.approx((0.2, 0.4, 0.8))


def test_a_world_of_nodes_is_shown_in_each_direction_and_made_once() -> None:
    """The direction is the colour: blue above, red along x."""
    world = new_world()
    place = world.node_tree.nodes.new("ShaderNodeTexCoord")
    background = world.node_tree.nodes["Background"]
    world.node_tree.links.new(place.outputs["Generated"], background.inputs["Color"])
    cache = ReadCache()
    first, second = (read_scene(evaluated(), SHADING, cache=cache) for _ in range(2))
    pixels = first.images[first.world.image].pixels
    height, width = pixels.shape[:2]
    assert pixels[-1, 0, :3] == pytest.approx((0.0, 0.0, 1.0), abs=3e-3)
    assert pixels[height // 2, width // 2, :3] == pytest.approx((1.0, 0.0, 0.0), abs=3e-3)
    assert pixels[height // 2, width // 4, :3] == pytest.approx((0.0, 1.0, 0.0), abs=3e-3)
    assert second.images[second.world.image].pixels is pixels
    background.inputs["Strength"].default_value = 2.0
    third = read_scene(evaluated(), SHADING, cache=cache)
    assert third.images[third.world.image].pixels[-1, 0, 2] == pytest.approx(2.0, abs=6e-3)


def test_environment_image_with_rotation() -> None:
    world = new_world()
    texture = world.node_tree.nodes.new("ShaderNodeTexEnvironment")
    mapping = world.node_tree.nodes.new("ShaderNodeMapping")
    texture.image = new_image(float_buffer=True)
    place = world.node_tree.nodes.new("ShaderNodeTexCoord")
    world.node_tree.links.new(place.outputs["Generated"], mapping.inputs["Vector"])
    mapping.inputs["Rotation"].default_value = (0.0, 0.0, 0.5)
    world.node_tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    world.node_tree.links.new(texture.outputs["Color"], world.node_tree.nodes["Background"].inputs["Color"])
    record = read()
    assert record.world.image == 0
    assert record.world.rotation == pytest.approx(0.5)
    assert record.images[0].pixels.shape == (2, 4, 4)
