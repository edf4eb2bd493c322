"""Values of instances in nodes (Object Info, attributes of objects and instancers), compared with Cycles' picture.

Everything emits the value itself. So pictures are equal pixel by pixel, except at the edges of the surfaces.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender import instancer_scenes  # noqa: E402
from blender.builders import (  # noqa: E402
    collection,
    collection_instance,
    instances_on_grid,
    made_cube,
    mesh_object,
    object_info,
)
from blender.node_setups import add, four_colors, new_red, shader, surface  # noqa: E402
from oracles.cycles import preserved, render_passes  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

SIZE = (96, 64)
Output = Callable[[Any], Any]


@pytest.fixture(autouse=True)
def empty() -> Iterator[None]:
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    yield
    clear_syncs()
    perfect_bvh_addon.unregister()


def show(output: Output) -> None:
    """Make all objects emit `output` of a node tree, and set up a distant camera."""
    material = new_red("Shown")
    material.pass_index = 3
    tree = material.node_tree
    tree.links.new(add(tree, "Emission", (output(tree), 0)).outputs[0], surface(material))
    show_material(material)


def show_material(material: Any) -> None:
    scene = bpy.context.scene
    scene.view_layers[0].material_override = material
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *SIZE, 100
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 16.0
    camera.location, camera.rotation_euler = (4.0, -20.0, 12.0), (1.1, 0.0, 0.2)
    scene.collection.objects.link(camera)
    scene.camera = camera
    bpy.context.view_layer.update()


def both() -> tuple[np.ndarray, np.ndarray]:
    """(N, 4): our values and Cycles' in pixels where both see a surface at the same position."""
    scene = bpy.context.scene
    scene.perfect_bvh.samples = 1
    with preserved(
        (scene.cycles, "samples", 1),
        (scene.cycles, "use_denoising", False),
        (scene.cycles, "filter_width", 0.01),
        (scene.cycles, "max_bounces", 0),
        (scene.render, "filter_size", 0.01),
    ):
        ours, theirs = (render_passes(scene, engine) for engine in ("PERFECT_BVH", "CYCLES"))
    inside = (ours.depth < 1e3) & (np.abs(ours.depth - theirs.depth) < 0.01)
    return ours.combined[inside], theirs.combined[inside]


def check(least_colors: int = 2, tolerance: float = 2e-5, others: float = 0.02) -> None:
    """Check that the values agree, and that at least `least_colors` of them are distinct."""
    ours, theirs = both()
    assert len(ours) > 50
    wrong = np.abs(ours - theirs) > tolerance * np.maximum(np.abs(theirs), 1.0)
    is_wrong = wrong.any(axis=1)
    # A pixel at the edge of two instances that touch may show either of them.
    assert np.count_nonzero(is_wrong) <= len(ours) * others, (ours[is_wrong][:5], theirs[is_wrong][:5])
    assert len(np.unique(np.round(theirs[~is_wrong], 4), axis=0)) >= least_colors


def info(name: str, scale: float = 1.0, more: float = 0.0) -> Output:
    def output(tree: Any) -> Any:
        value = add(tree, "ObjectInfo").outputs[name]
        if name == "Color":
            return value
        node = add(tree, "Math", (value, 0))
        node.operation, node.inputs[1].default_value, node.inputs[2].default_value = "MULTIPLY_ADD", scale, more
        return node.outputs[0]

    return output


def attribute(name: str, kind: str = "INSTANCER", output: str = "Color") -> Output:
    def made(tree: Any) -> Any:
        node = add(tree, "Attribute")
        node.attribute_name, node.attribute_type = name, kind
        return node.outputs[output]

    return made


def cubes() -> list[Any]:
    """Some plain objects with distinct names, colours and numbers."""
    made = []
    for number, name in enumerate(("Kühe", "cube", "plain name.001", "日本")):
        obj = mesh_object(name, location=(1.5 * number, 0.0, 1.0 * number))
        obj.scale = (1.2, 1.2, 1.2)
        obj.color = (0.1 * number, 0.5, 1.0 - 0.2 * number, 0.25 * number)
        obj.pass_index = number
        obj["weight"], obj["count"], obj["shade"] = 0.3 * number, number, (0.2, 0.1 * number, 0.7)
        obj["flag"] = bool(number % 2)
        obj.data["thickness"] = 0.15 * number
        made.append(obj)
    return made


# Object Info ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "scale"), [("Random", 1.0), ("Color", 1.0), ("Alpha", 1.0), ("Object Index", 0.25), ("Location", 0.125)]
)
def test_object_info_of_plain_objects(name: str, scale: float) -> None:
    cubes()
    show(info(name, scale))
    check(4)


def test_the_material_index_is_one_for_all() -> None:
    cubes()
    show(info("Material Index", 0.125))
    ours, theirs = both()
    np.testing.assert_allclose(ours, theirs, atol=1e-5)
    assert theirs[:, 0].max() == pytest.approx(0.375)


def on_vertices() -> None:
    parent = mesh_object("points", location=(2.0, 0.0, 0.0))
    parent.scale = (3.0, 3.0, 3.0)
    child = mesh_object("child")
    child.scale = (0.2, 0.2, 0.2)
    child.parent, parent.instance_type = parent, "VERTS"


def from_a_collection() -> None:
    inner = collection("inner", linked=False)
    mesh_object("one", collection=inner), mesh_object("other", collection=inner, location=(3.0, 0.0, 0.0))
    for number in range(2):
        collection_instance(f"empty {number}", inner, location=(0.0, 3.0 * number, 2.0))


def from_particles() -> None:
    source = mesh_object("source", location=(0.0, 0.0, -40.0))
    source.scale = (0.7, 0.7, 0.7)
    bpy.ops.mesh.primitive_grid_add(size=12.0, x_subdivisions=3, y_subdivisions=3)
    obj = bpy.context.object
    obj.name = "emitter"
    settings = obj.modifiers.new("particles", "PARTICLE_SYSTEM").particle_system.settings
    settings.type, settings.count, settings.render_type, settings.use_advanced_hair = "HAIR", 12, "OBJECT", True
    settings.instance_object, settings.particle_size = source, 0.3
    settings["wind"] = 0.625


def instancers_in_a_collection() -> None:
    """Instances of instancers, which only Blender's list knows."""
    field, holder = instances_on_grid("field", made_cube, 3), collection("holder", linked=False)
    bpy.context.scene.collection.objects.unlink(field)
    holder.objects.link(field)
    for number in range(2):
        collection_instance(f"group {number}", holder, location=(0.0, 0.0, 4.0 * number))


def nested_nodes() -> None:
    source = instances_on_grid("source", made_cube, 2)
    source.scale = (0.2, 0.2, 0.2)
    instances_on_grid("field", object_info(source), 3)
    nodes = bpy.data.objects["field"].modifiers[0].node_group.nodes
    next(node for node in nodes if node.bl_idname == "GeometryNodeObjectInfo").transform_space = "RELATIVE"


@pytest.mark.parametrize(
    "build",
    [
        on_vertices,
        from_a_collection,
        from_particles,
        instancers_in_a_collection,
        instancer_scenes.made_meshes,
        instancer_scenes.an_object,
        instancer_scenes.ids_of_their_own,
        instancer_scenes.beside_text_and_curves,
        nested_nodes,
        instancer_scenes.a_whole_collection,
        instancer_scenes.beside_particles,
        instancer_scenes.listed_ones_among_others,
    ],
)
@pytest.mark.parametrize("name", ["Random", "Location"])
def test_instances_of_every_kind_have_cycles_numbers(build: Callable[[], object], name: str) -> None:
    build()
    show(info(name) if name == "Random" else info(name, 0.0625, 0.75))
    check()


@pytest.mark.parametrize("build", [on_vertices, from_a_collection, instancers_in_a_collection, nested_nodes])
@pytest.mark.parametrize("name", ["Color", "Alpha"])
def test_instances_have_their_instancers_color(build: Callable[[], object], name: str) -> None:
    build()
    for number, obj in enumerate(sorted(bpy.data.objects, key=lambda obj: obj.name)):
        obj.color = (0.1 * number, 0.5, 1.0 - 0.1 * number, 0.1 + 0.1 * number)
    show(info(name))
    check(2 if build in (from_a_collection, instancers_in_a_collection) else 1)


# Attributes ----------------------------------------------------------------------------------------------------------


def stored(kind: str, name: str = "mark") -> None:
    """Geometry nodes leave an attribute on their instances, with another value for each."""
    obj = instances_on_grid("field", made_cube, 3)
    store_index(obj, kind, name, bpy.data.node_groups["field"].nodes["Group Output"].inputs[0])


def store_index(obj: Any, kind: str, name: str, socket: Any) -> None:
    tree = obj.modifiers[0].node_group
    store = tree.nodes.new("GeometryNodeStoreNamedAttribute")
    store.data_type, store.domain = kind, "INSTANCE"
    store.inputs["Name"].default_value = name
    index = tree.nodes.new("GeometryNodeInputIndex").outputs[0]
    scaled = index
    if kind in {"FLOAT", "FLOAT_VECTOR", "FLOAT2"}:
        math = tree.nodes.new("ShaderNodeMath")
        math.operation, math.inputs[1].default_value = "MULTIPLY", 0.125
        tree.links.new(index, math.inputs[0])
        scaled = math.outputs[0]
    if kind in {"FLOAT_COLOR", "BYTE_COLOR"}:
        color = tree.nodes.new("FunctionNodeCombineColor")
        math = tree.nodes.new("ShaderNodeMath")
        math.operation, math.inputs[1].default_value = "MULTIPLY", 0.1
        tree.links.new(index, math.inputs[0])
        tree.links.new(math.outputs[0], color.inputs["Green"])
        color.inputs["Red"].default_value, color.inputs["Alpha"].default_value = 0.3, 0.5
        scaled = color.outputs[0]
    if kind == "BOOLEAN":
        compare = tree.nodes.new("FunctionNodeCompare")
        compare.data_type = "INT"
        compare.inputs["B"].default_value = 3
        tree.links.new(index, compare.inputs["A"])
        scaled = compare.outputs[0]
    tree.links.new(scaled, next(one for one in store.inputs if one.name == "Value" and one.enabled))
    tree.links.new(socket.links[0].from_socket, store.inputs["Geometry"])
    tree.links.new(store.outputs["Geometry"], socket)


@pytest.mark.parametrize("kind", ["FLOAT", "INT", "BOOLEAN", "FLOAT_VECTOR", "FLOAT2", "FLOAT_COLOR", "BYTE_COLOR"])
def test_attributes_that_geometry_nodes_leave_on_instances(kind: str) -> None:
    stored(kind)
    show(attribute("mark"))
    check(tolerance=1e-4)


@pytest.mark.parametrize("output", ["Fac", "Vector", "Alpha"])
def test_every_output_of_an_instances_attribute(output: str) -> None:
    stored("FLOAT_COLOR")
    show(attribute("mark", output=output))
    check(1 if output == "Alpha" else 2, tolerance=1e-4)


def test_attributes_go_by_the_id_of_an_instance() -> None:
    instancer_scenes.ids_of_their_own()
    obj = next(one for one in bpy.data.objects if one.modifiers)
    output = next(node for node in obj.modifiers[0].node_group.nodes if node.bl_idname == "NodeGroupOutput")
    store_index(obj, "FLOAT", "mark", output.inputs[0])
    show(attribute("mark"))
    check(tolerance=1e-4)


@pytest.mark.parametrize("place", ["inner", "outer", "both"])
def test_the_innermost_instances_have_the_first_word(place: str) -> None:
    nested_nodes()
    for name, kind in (("source", "inner"), ("field", "outer")):
        if place in {kind, "both"}:
            obj = bpy.data.objects[name]
            output = next(node for node in obj.modifiers[0].node_group.nodes if node.bl_idname == "NodeGroupOutput")
            store_index(obj, "FLOAT" if kind == "inner" else "INT", "mark", output.inputs[0])
    show(attribute("mark"))
    check(tolerance=1e-4)


PROPERTIES = ("weight", "count", "shade", "flag", "thickness", "location", "pass_index", "color", "nothing", "name")


@pytest.mark.parametrize("kind", ["OBJECT", "INSTANCER"])
@pytest.mark.parametrize("name", PROPERTIES)
def test_properties_of_plain_objects(name: str, kind: str) -> None:
    cubes()
    show(attribute(name, kind))
    check(1 if name in {"nothing", "name"} else 2)


@pytest.mark.parametrize("kind", ["OBJECT", "INSTANCER"])
@pytest.mark.parametrize(
    "build", [on_vertices, from_a_collection, instancer_scenes.an_object, instancer_scenes.made_meshes]
)
def test_properties_of_instancers_and_of_what_they_show(build: Callable[[], object], kind: str) -> None:
    build()
    for number, obj in enumerate(bpy.data.objects):
        obj["own"] = 0.125 * (number + 1)
    show(attribute("own", kind))
    check(1)


def test_the_settings_of_particles_have_the_first_word() -> None:
    from_particles()
    bpy.data.objects["source"]["wind"] = bpy.data.objects["emitter"]["wind"] = 0.25
    show(attribute("wind"))
    ours, theirs = both()
    np.testing.assert_allclose(ours, theirs, atol=1e-5)
    assert 0.6 < theirs[:, 0].max() < 0.65


# Results of nodes ----------------------------------------------------------------------------------------------------


def ramped(tree: Any) -> Any:
    ramp = add(tree, "ValToRGB", (add(tree, "ObjectInfo").outputs["Random"], 0)).color_ramp
    ramp.elements[0].color, ramp.elements[1].color = (0.9, 0.1, 0.0, 1.0), (0.0, 0.3, 0.8, 1.0)
    return tree.nodes[-1].outputs[0]


def turned_in_hue(tree: Any) -> Any:
    return add(
        tree, "HueSaturation", (add(tree, "ObjectInfo").outputs["Random"], 0), Color=(0.8, 0.2, 0.1, 1.0)
    ).outputs[0]


def mixed(tree: Any) -> Any:
    node = add(tree, "Mix")
    node.data_type = "RGBA"
    sockets = [socket for socket in node.inputs if socket.enabled]
    tree.links.new(add(tree, "ObjectInfo").outputs["Random"], sockets[0])
    sockets[1].default_value, sockets[2].default_value = (0.1, 0.5, 0.2, 1.0), (0.9, 0.0, 0.4, 1.0)
    return next(socket for socket in node.outputs if socket.enabled)


def image_times_color(tree: Any) -> Any:
    image = tree.nodes.new("ShaderNodeTexImage")
    image.image, image.interpolation = four_colors(), "Closest"
    node = add(tree, "Mix")
    node.data_type, node.blend_type = "RGBA", "MULTIPLY"
    sockets = [socket for socket in node.inputs if socket.enabled]
    sockets[0].default_value = 1.0
    tree.links.new(image.outputs[0], sockets[1])
    tree.links.new(add(tree, "ObjectInfo").outputs["Color"], sockets[2])
    return next(socket for socket in node.outputs if socket.enabled)


@pytest.mark.parametrize("output", [ramped, turned_in_hue, mixed])
def test_nodes_change_what_instances_have(output: Output) -> None:
    instancer_scenes.made_meshes()
    show(output)
    check(5, tolerance=0.01)  # the ramp is a table


def test_an_image_is_multiplied_with_each_objects_color() -> None:
    for obj in cubes():
        obj.data.uv_layers.new(name="map")
    show(image_times_color)
    check(3, tolerance=0.02, others=0.1)  # at the borders of the image's colours


def test_the_strength_of_emission_and_alpha_may_be_the_instances_own() -> None:
    cubes()
    material = new_red("Shown")
    tree = material.node_tree
    color = add(tree, "ObjectInfo")
    tree.links.new(color.outputs["Random"], shader(material).inputs["Emission Strength"])
    tree.links.new(color.outputs["Alpha"], shader(material).inputs["Alpha"])
    shader(material).inputs["Base Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    bpy.context.scene.render.film_transparent = True
    show_material(material)
    bpy.context.scene.cycles.transparent_max_bounces = 8
    scene = bpy.context.scene
    scene.perfect_bvh.samples = 8
    with preserved(
        (scene.cycles, "samples", 256),
        (scene.cycles, "use_denoising", False),
        (scene.cycles, "filter_width", 0.01),
        (scene.render, "filter_size", 0.01),
    ):
        ours, theirs = (render_passes(scene, engine) for engine in ("PERFECT_BVH", "CYCLES"))
    for number in range(1, 4):
        both_sides = 1.0 - (1.0 - 0.25 * number) ** 2
        seen = [np.abs(passes.combined[..., 3] - both_sides) < 0.03 for passes in (ours, theirs)]
        assert np.count_nonzero(seen[0] & seen[1]) > 3
        medians = [np.median(passes.combined[seen[0] & seen[1]], axis=0) for passes in (ours, theirs)]
        np.testing.assert_allclose(*medians, atol=0.02)
