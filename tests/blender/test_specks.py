"""No specks in mode "preview": rough metals and plastics next to small bright objects, as Cycles shows them.

A speck is a pixel that is brighter than all of the converged picture around it. With few rays a pixel, finding small
lights by chance would leave some on every shiny object. Seeds are fixed.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import perfect_bvh
import pytest

bpy = pytest.importorskip("bpy")

from blender.spheres import add_uv_sphere  # noqa: E402
from oracles.cycles import preserved, render_noisy  # noqa: E402
from perfect_bvh_addon import SceneSync  # noqa: E402
from perfect_bvh_addon.settings.scene_settings import read_light_paths  # noqa: E402
from perfect_bvh_addon.sync.records import AttributeRequest  # noqa: E402

Image = npt.NDArray[np.float32]
SIZE = (64, 36)
SAMPLES, CONVERGED = 16, 192


def principled(color: tuple[float, float, float], metallic: float, roughness: float) -> bpy.types.Material:
    material = bpy.data.materials.new("Shiny")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (*color, 1.0)
    inputs["Metallic"].default_value, inputs["Roughness"].default_value = metallic, roughness
    return material


def ball(place: tuple[float, float, float], radius: float, material: bpy.types.Material) -> None:
    add_uv_sphere(radius=radius, location=place, segments=32, ring_count=16)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(material)


@pytest.fixture
def shop(scene: bpy.types.Scene) -> bpy.types.Scene:
    """Spheres of metal and plastic, smooth to rough, on a floor in front of a metal wall; there is no light yet."""
    bpy.ops.mesh.primitive_plane_add(size=40.0)
    bpy.context.object.data.materials.append(principled((0.4, 0.4, 0.4), 0.0, 0.45))
    bpy.ops.mesh.primitive_plane_add(size=40.0, location=(0.0, 5.0, 0.0), rotation=(math.pi / 2, 0.0, 0.0))
    bpy.context.object.data.materials.append(principled((0.5, 0.45, 0.4), 1.0, 0.35))
    for number, roughness in enumerate((0.05, 0.2, 0.4, 0.6)):
        ball((-2.7 + 1.8 * number, 0.0, 0.8), 0.8, principled((0.9, 0.8, 0.6), 1.0, roughness))
        ball((-2.4 + 1.6 * number, -2.0, 0.5), 0.5, principled((0.6, 0.1, 0.1), 0.0, roughness))
    bpy.ops.object.camera_add(location=(0.0, -11.0, 4.2), rotation=(math.radians(71), 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.camera.data.lens = 40.0
    scene.world = bpy.data.worlds.new("World")
    if bpy.app.version < (5, 0, 0):
        scene.world.use_nodes = True
    background(scene).inputs["Color"].default_value = (0.05, 0.05, 0.05, 1.0)
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    return scene


def background(scene: bpy.types.Scene) -> bpy.types.Node:
    return next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")


def add_emissive_balls(scene: bpy.types.Scene) -> None:
    for x, y, z, radius, strength in ((-2.0, -1.0, 2.6, 0.06, 800.0), (1.5, -1.2, 2.2, 0.05, 1000.0)):
        bpy.ops.mesh.primitive_ico_sphere_add(radius=radius, location=(x, y, z), subdivisions=2)
        material = principled((0.0, 0.0, 0.0), 0.0, 1.0)
        inputs = material.node_tree.nodes["Principled BSDF"].inputs
        inputs["Emission Color"].default_value = (1.0, 0.9, 0.8, 1.0)
        inputs["Emission Strength"].default_value = strength
        bpy.context.object.data.materials.append(material)
        bpy.context.object.visible_camera = False


def add_area_lights(scene: bpy.types.Scene) -> None:
    for place, turn, shape in (((-2.5, -1.0, 4.0), 0.3, "RECTANGLE"), ((2.5, -1.0, 3.0), -0.4, "DISK")):
        bpy.ops.object.light_add(type="AREA", location=place, rotation=(0.2, turn, 0.0))
        light = bpy.context.object.data
        light.energy, light.shape, light.size, light.size_y = 200.0, shape, 1.5, 0.8


def add_sun_in_the_sky(scene: bpy.types.Scene) -> None:
    wide, high = 256, 128
    pixels = np.full((high, wide, 4), 0.2, np.float32)
    pixels[..., 3] = 1.0
    pixels[100:102, 70:72, :3] = 6000.0
    image = bpy.data.images.new("Sky", wide, high, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    nodes = scene.world.node_tree.nodes
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    scene.world.node_tree.links.new(texture.outputs["Color"], background(scene).inputs["Color"])


LIGHTS: dict[str, Callable[[bpy.types.Scene], None]] = {
    "emissive balls": add_emissive_balls,
    "area lights": add_area_lights,
    "sun in the sky": add_sun_in_the_sky,
}


def previews(paths: perfect_bvh.LightPaths) -> tuple[Image, Image]:
    """Render (H, W, 3): with few samples, and converged with other random numbers."""
    sync = SceneSync(attributes=AttributeRequest(material_slots=True, corner_normals=True, shading=True))
    sync.update(bpy.context.evaluated_depsgraph_get())
    few, converged = (
        perfect_bvh.render(
            sync.scene, sync.camera, "preview", SIZE, samples, appearance=sync.appearance, seed=seed, light_paths=paths
        )[..., :3]
        for samples, seed in ((SAMPLES, 1), (CONVERGED, 2))
    )
    return few, converged


def specks(image: Image, converged: Image) -> npt.NDArray[np.float64]:
    """(H, W): the excess of each pixel over the converged pixels around it, relative to these and the mean."""
    brightness, wanted = (each.max(axis=-1).astype(np.float64) for each in (image, converged))
    padded = np.pad(wanted, 1, mode="edge")
    height, width = wanted.shape
    around = np.max([padded[y : y + height, x : x + width] for y in range(3) for x in range(3)], axis=0)
    return (brightness - around) / (around + 0.1 * wanted.mean())


@pytest.mark.parametrize(("lit_by", "most"), [("emissive balls", 4.0), ("area lights", 0.35), ("sun in the sky", 1.5)])
def test_shiny_things_beside_small_bright_ones_show_no_specks(shop: bpy.types.Scene, lit_by: str, most: float) -> None:
    """In direct light only. Light that shiny objects reflect onto others is left to chance and denoising."""
    LIGHTS[lit_by](shop)
    assert specks(*previews(perfect_bvh.LightPaths(max_bounces=0))).max() < most


@pytest.mark.parametrize("lit_by", LIGHTS)
def test_shiny_things_look_as_in_cycles_under_small_bright_ones(shop: bpy.types.Scene, lit_by: str) -> None:
    """The means of patches of 4 x 4 pixels are compared."""
    LIGHTS[lit_by](shop)
    _, ours = previews(read_light_paths(shop))
    cycles = shop.cycles
    with preserved(
        (cycles, "samples", 64),
        (cycles, "use_denoising", False),
        (cycles, "use_adaptive_sampling", False),
    ):
        theirs = render_noisy(shop, "CYCLES")[..., :3]
    ours, theirs = (np.minimum(each, 2.0).reshape(9, 4, 16, 4, 3).mean(axis=(1, 3)) for each in (ours, theirs))
    assert np.abs(ours - theirs).mean() < 0.13 * theirs.mean()
