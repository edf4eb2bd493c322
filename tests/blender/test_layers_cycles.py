"""The uv map of each image, and the colours of a mesh, in the mode "preview", compared with Cycles' picture.

A floor is seen from above and emits its own light only, so that both pictures show the images unchanged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.node_setups import add, image_node, new_red, paint, shader, surface  # noqa: E402
from oracles.cycles import preserved, render_noisy  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

SIDE, PATCH, SAMPLES, CELLS = 64, 4, 16, 8
MODERN_NAMES = bpy.app.version >= (4, 0, 0)


@pytest.fixture
def scene() -> Iterator[bpy.types.Scene]:
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_grid_add(size=2.0, x_subdivisions=CELLS, y_subdivisions=CELLS)
    floor = bpy.context.object
    floor.name = "Floor"
    for name, place in (("Turned", lambda u, v: (1.0 - v, u)), ("Wide", lambda u, v: (3.0 * u - 0.7, 0.5 * v))):
        layer = floor.data.uv_layers.new(name=name)
        for own, first in zip(layer.uv, floor.data.uv_layers[0].uv, strict=True):
            own.vector = place(*first.vector)
    paint(floor.data)
    bpy.ops.object.camera_add(location=(0.0, 0.0, 4.0))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 2.0
    scene.render.resolution_x = scene.render.resolution_y = SIDE
    scene.perfect_bvh.samples, scene.perfect_bvh.use_noise_threshold = SAMPLES, False
    yield scene
    clear_syncs()
    perfect_bvh_addon.unregister()


def patches(image: np.ndarray) -> np.ndarray:
    """(SIDE / PATCH, SIDE / PATCH, 3): the mean colour of each patch."""
    return image[..., :3].reshape(SIDE // PATCH, PATCH, SIDE // PATCH, PATCH, 3).mean(axis=(1, 3))


def check(scene: Any) -> np.ndarray:
    """Return the patches of our picture, after a comparison with those of Cycles."""
    cycles = scene.cycles
    with preserved(
        (cycles, "samples", SAMPLES), (cycles, "use_denoising", False), (cycles, "use_adaptive_sampling", False)
    ):
        theirs = patches(render_noisy(scene, "CYCLES"))
    ours = patches(render_noisy(scene, "PERFECT_BVH"))
    assert np.abs(ours - theirs).mean() < 0.02
    assert np.abs(ours - theirs).max() < 0.25  # one of few samples across an edge
    return ours


def floor_mesh(scene: Any) -> Any:
    return scene.objects["Floor"].data


def emissive(scene: Any, output: Callable[[Any], Any]) -> Any:
    """Give the floor a new material that emits the output of nodes made by `output`; return the material."""
    material = new_red()
    tree = material.node_tree
    tree.links.new(add(tree, "Emission", (output(tree), 0)).outputs[0], surface(material))
    floor_mesh(scene).materials.append(material)
    return material


def looked_up(tree: Any, coordinates: Any) -> Any:
    """Look up an image that is extended at its edges: a corner shows one pixel, not a mix of four corners."""
    image = image_node(tree)
    image.extension = "EXTEND"
    tree.links.new(coordinates, image.inputs[0])
    return image.outputs[0]


def uv_map(tree: Any, name: str) -> Any:
    node = add(tree, "UVMap")
    node.uv_map = name
    return node.outputs[0]


def attribute(tree: Any, name: str, output: str = "Vector") -> Any:
    node = add(tree, "Attribute")
    node.attribute_name = name
    return node.outputs[output]


def moved(tree: Any, coordinates: Any) -> Any:
    return add(tree, "Mapping", (coordinates, 0), Scale=(0.5, 2.0, 1.0), Location=(0.2, 0.1, 0.0)).outputs[0]


COORDINATES: dict[str, Callable[[Any], Any]] = {
    "uv map": lambda tree: uv_map(tree, "Turned"),
    "active map": lambda tree: uv_map(tree, ""),
    "active map by its name": lambda tree: uv_map(tree, "UVMap"),
    "attribute": lambda tree: attribute(tree, "Wide"),
    "colour of an attribute": lambda tree: attribute(tree, "Wide", "Color"),
    "moved": lambda tree: moved(tree, uv_map(tree, "Wide")),
    "texture coordinate": lambda tree: add(tree, "TexCoord").outputs["UV"],
    "a map that is not there": lambda tree: uv_map(tree, "nothing"),
    "moved without a map": lambda tree: moved(tree, uv_map(tree, "nothing")),
}


@pytest.mark.parametrize("name", COORDINATES)
def test_images_lie_on_the_map_that_nodes_name(scene, name: str) -> None:
    emissive(scene, lambda tree: looked_up(tree, COORDINATES[name](tree)))
    check(scene)


def test_a_mesh_without_uv_maps(scene) -> None:
    layers = floor_mesh(scene).uv_layers
    for name in [layer.name for layer in layers]:
        layers.remove(layers[name])
    emissive(scene, lambda tree: looked_up(tree, add(tree, "TexCoord").outputs["UV"]))
    assert np.ptp(check(scene), axis=(0, 1)).max() < 0.01


def test_two_materials_of_a_mesh_have_maps_of_their_own(scene) -> None:
    for name in ("Turned", "Wide"):
        emissive(scene, lambda tree, name=name: looked_up(tree, uv_map(tree, name)))
    for polygon in floor_mesh(scene).polygons:
        polygon.material_index = int(polygon.center.x > 0)
    check(scene)


def test_two_images_of_a_material_have_maps_of_their_own(scene) -> None:
    """One image is the emission, the other one cuts holes."""
    material = new_red()
    tree, inputs = material.node_tree, shader(material).inputs
    inputs["Base Color"].default_value, inputs["Emission Strength"].default_value = (0.0, 0.0, 0.0, 1.0), 1.0
    tree.links.new(looked_up(tree, uv_map(tree, "Wide")), inputs["Emission Color"])
    holes = image_node(tree, has_holes=True)
    tree.links.new(uv_map(tree, "Turned"), holes.inputs[0])
    tree.links.new(holes.outputs["Alpha"], inputs["Alpha"])
    floor_mesh(scene).materials.append(material)
    check(scene)


def test_edits_of_maps_and_of_what_names_them_show(scene) -> None:
    """Each edit shows in the next picture, which equals Cycles' again."""
    material = emissive(scene, lambda tree: looked_up(tree, uv_map(tree, "Turned")))
    mesh = floor_mesh(scene)
    node = next(node for node in material.node_tree.nodes if node.type == "UVMAP")
    first = check(scene)
    node.uv_map = "Wide"
    second = check(scene)
    assert np.abs(second - first).max() > 0.2
    mesh.uv_layers["Wide"].name = "Other"
    third = check(scene)
    assert np.ptp(third, axis=(0, 1)).max() < 0.01
    mesh.uv_layers["Turned"].name = "Wide"
    assert check(scene) == pytest.approx(first, abs=0.1)
    mesh.uv_layers.remove(mesh.uv_layers["Wide"])
    assert check(scene) == pytest.approx(third, abs=0.1)
    node.uv_map = ""
    mesh.uv_layers["Other"].active_render = True
    assert check(scene) == pytest.approx(second, abs=0.1)


def diffuse(scene: Any, output: Callable[[Any], Any]) -> None:
    """A diffuse floor in white light from all around."""
    scene.world = bpy.data.worlds.new("World")
    scene.world.color, scene.world.use_nodes = (1.0, 1.0, 1.0), False
    material = new_red()
    tree = material.node_tree
    tree.links.new(add(tree, "BsdfDiffuse", (output(tree), 0)).outputs[0], surface(material))
    floor_mesh(scene).materials.append(material)


def painted(tree: Any, name: str) -> Any:
    node = add(tree, "VertexColor")
    node.layer_name = name
    return node.outputs["Color"]


COLORS: dict[str, Callable[[Any], Any]] = {
    "by name": lambda tree: painted(tree, "Paint"),
    "another": lambda tree: painted(tree, "Flat"),
    "the active ones": lambda tree: painted(tree, ""),
    "none": lambda tree: painted(tree, "nothing"),
    "attribute": lambda tree: attribute(tree, "Flat", "Color"),
    "attribute without a name": lambda tree: attribute(tree, "", "Color"),
    "number": lambda tree: attribute(tree, "warmth", "Color"),
    "uv map": lambda tree: attribute(tree, "Turned", "Color"),
}


@pytest.mark.parametrize("name", COLORS)
def test_colors_are_those_that_nodes_name(scene, name: str) -> None:
    mesh = floor_mesh(scene)
    mesh.attributes.new("warmth", "FLOAT", "POINT").data.foreach_set("value", np.linspace(0, 1, len(mesh.vertices)))
    flat = mesh.color_attributes.new("Flat", "BYTE_COLOR", "POINT")
    flat.data.foreach_set("color", np.tile(np.float32((0.2, 0.9, 0.4, 1.0)), len(mesh.vertices)))
    diffuse(scene, COLORS[name])
    check(scene)
