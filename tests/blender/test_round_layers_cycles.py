"""Images and colours on hair, points and particle hair, in the mode "preview", compared with Cycles' picture.

Each surface is alone in white light, or emits its own light only: a pixel shows exactly the value of its material.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import bpy
import numpy as np
import perfect_bvh_addon
import pytest
from blender.hair_and_points import cloud_object, hair_object
from blender.node_setups import add, new_red, surface
from blender.particle_hair import add_hair, emitter
from oracles.cycles import preserved, render_noisy
from perfect_bvh_addon.live.sync_cache import clear_syncs

WIDTH, HEIGHT, SAMPLES = 96, 64, 16
KINDS = ("curves", "points")
STRANDS, KEYS = 6, 4


@pytest.fixture
def scene() -> Iterator[bpy.types.Scene]:
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.object.camera_add(location=(0.0, 0.0, 4.0))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 6.0
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.perfect_bvh.samples, scene.perfect_bvh.use_noise_threshold = SAMPLES, False
    scene.cycles_curves.shape = "THICK"
    yield scene
    clear_syncs()
    perfect_bvh_addon.unregister()


def shown(kind: str) -> Any:
    """Six strands along y, or the same number of points, side by side."""
    x = np.arange(STRANDS) - 2.5
    if kind == "points":
        return cloud_object("Cloud", np.stack([x, 0 * x, 0 * x], axis=1), 0.35)
    strands = np.zeros((STRANDS, KEYS, 3))
    strands[..., 0], strands[..., 1] = x[:, None], np.linspace(-1.5, 1.5, KEYS)
    return hair_object("Hair", strands, 0.2)


def pictures(scene: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return our image and Cycles', (H, W, 4) each."""
    cycles = scene.cycles
    with preserved(
        (cycles, "samples", SAMPLES), (cycles, "use_denoising", False), (cycles, "use_adaptive_sampling", False)
    ):
        theirs = render_noisy(scene, "CYCLES")
    return render_noisy(scene, "PERFECT_BVH"), theirs


def check(scene: Any, tolerance: float = 0.02) -> np.ndarray:
    """Check our colours inside the shown surfaces against those of Cycles; return them: (N, 3)."""
    scene.render.film_transparent = True
    ours, theirs = pictures(scene)
    inside = (ours[..., 3] > 0.999) & (theirs[..., 3] > 0.999)
    assert inside.mean() > 0.05
    difference = np.abs(ours - theirs)[inside]
    assert difference.max() < 8 * tolerance
    assert difference.mean() < tolerance
    return ours[inside][:, :3]


def show_color(scene: Any, data: Any, output: Callable[[Any], Any]) -> None:
    scene.world = scene.world or bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (1.0, 1.0, 1.0, 1.0)
    material = new_red()
    tree = material.node_tree
    tree.links.new(add(tree, "BsdfDiffuse", (output(tree), 0)).outputs[0], surface(material))
    data.materials.append(material)


def ramp(size: int = 64) -> Any:
    """An image whose red and green are the coordinates of the lookup, except for half a pixel at the border."""
    image = bpy.data.images.new("ramp", size, size, float_buffer=True, is_data=True)
    pixels = np.ones((size, size, 4), np.float32)
    steps = (np.arange(size) + 0.5) / size
    pixels[..., 0], pixels[..., 1], pixels[..., 2] = steps, steps[:, None], 0.5
    image.pixels.foreach_set(pixels.ravel())
    return image


def show_image(data: Any, output: Callable[[Any], Any] | None = None) -> None:
    """Let the material emit an image. output: the lookup's position; None: Blender's default."""
    material = new_red()
    tree = material.node_tree
    image = add(tree, "TexImage")
    image.image, image.extension = ramp(), "EXTEND"
    if output is not None:
        tree.links.new(output(tree), image.inputs[0])
    tree.links.new(add(tree, "Emission", (image.outputs[0], 0)).outputs[0], surface(material))
    data.materials.append(material)


def named(name: str, output: str = "Color") -> Callable[[Any], Any]:
    def make(tree: Any) -> Any:
        node = add(tree, "Attribute")
        node.attribute_name = name
        return node.outputs[output]

    return make


def store(data: Any, name: str, kind: str, domain: str, seed: int = 1) -> None:
    """Store random numbers as an attribute."""
    properties = {"FLOAT": ("value", 1), "FLOAT2": ("vector", 2), "FLOAT_VECTOR": ("vector", 3)}
    prop, width = properties.get(kind, ("color", 4))
    attribute = data.attributes.get(name) or data.attributes.new(name, kind, domain)
    values = np.random.default_rng(seed).uniform(0.1, 0.9, len(attribute.data) * width)
    attribute.data.foreach_set(prop, values.astype(np.float32))
    data.update_tag()


ATTRIBUTES = [
    *(("curves", domain, kind) for domain in ("POINT", "CURVE") for kind in ("FLOAT", "FLOAT_VECTOR", "FLOAT_COLOR")),
    *(("curves", "POINT", kind) for kind in ("FLOAT2", "BYTE_COLOR")),
    *(("points", "POINT", kind) for kind in ("FLOAT", "FLOAT2", "FLOAT_VECTOR", "FLOAT_COLOR", "BYTE_COLOR")),
]


@pytest.mark.parametrize(("kind", "domain", "type_"), ATTRIBUTES)
def test_attributes_color_hair_and_points(scene: Any, kind: str, domain: str, type_: str) -> None:
    data = shown(kind).data
    store(data, "Paint", type_, domain)
    show_color(scene, data, named("Paint"))
    assert np.ptp(check(scene), axis=0).max() > 0.3
    if type_ == "FLOAT_COLOR":
        before = check(scene)
        store(data, "Paint", type_, domain, seed=2)
        assert np.abs(check(scene) - before).max() > 0.2


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_lacking_is_black_and_named(scene: Any, kind: str) -> None:
    show_color(scene, shown(kind).data, named("nothing"))
    assert check(scene).max() < 0.01


def test_images_lie_at_the_roots_of_hair(scene: Any) -> None:
    data = shown("curves").data
    store(data, "weights", "FLOAT", "CURVE")
    store(data, "surface_uv_coordinate", "FLOAT2", "CURVE")
    store(data, "other", "FLOAT2", "CURVE", seed=5)
    show_image(data)
    first = check(scene)
    assert len(np.unique(first.round(2), axis=0)) > 2
    data.materials.clear()
    show_image(data, named("other", "Vector"))
    assert np.abs(check(scene) - first).max() > 0.2


def test_images_lie_at_the_places_of_points(scene: Any) -> None:
    data = shown("points").data
    store(data, "where", "FLOAT2", "POINT")
    show_image(data, named("where", "Vector"))
    assert len(np.unique(check(scene).round(2), axis=0)) > 2
    data.materials.clear()
    show_image(data)
    assert len(np.unique(check(scene).round(2), axis=0)) == 1


@pytest.mark.parametrize("children", ["NONE", "SIMPLE", "INTERPOLATED"])
def test_particle_hair_has_the_images_and_materials_of_its_emitter(scene: Any, children: str) -> None:
    """Two systems: one has an image by the emitter's map, the other has a separate material of white light."""
    settings = {"radius_scale": 0.3, "tip_radius": 1.0, "hair_length": 1.0, "count": 8, "render_step": 2}
    settings |= {"child_type": children, "rendered_child_count": 2}
    obj = emitter(**settings)
    obj.location, obj.rotation_euler = (-1.5, -0.5, 0.0), (1.0, 0.2, 0.0)  # Cycles' hair has no ends
    other = add_hair(obj, **settings)
    show_image(obj.data)
    material = new_red()
    white = add(material.node_tree, "Emission").outputs[0]
    material.node_tree.links.new(white, surface(material))
    obj.data.materials.append(material)
    other.material, obj.particle_systems[1].seed = 2, 5
    obj.show_instancer_for_render = False
    scene.render.film_transparent = True
    ours, theirs = pictures(scene)
    inside = (ours[..., 3] > 0.999) & (theirs[..., 3] > 0.999)
    difference = np.abs(ours - theirs)[inside].max(axis=1)
    assert np.median(difference) < 0.002
    assert np.quantile(difference, 0.7) < 0.1  # the rest lies where one strand hides another
    assert len(np.unique(ours[ours[..., 3] > 0.999].round(1), axis=0)) > 3
    assert (ours > 0.99).all(axis=2).any()
