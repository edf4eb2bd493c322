"""Shadow catchers in the mode "preview", compared with Cycles: only the shadows, over nothing or over the world.

Both divide the light on them by the light that there would be without shadows. Cycles divides the means over all
samples, ours divides in each sample. The results differ where objects reflect light back onto their shadows.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.node_setups import new_red  # noqa: E402
from oracles.cycles import render_beside, render_passes  # noqa: E402
from perfect_bvh_addon import SceneSync  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

SIZE, PATCH, SAMPLES = (96, 64), 8, 64
Image = npt.NDArray[np.float32]


@pytest.fixture
def scene() -> Iterator[Any]:
    """A cube on a floor that catches shadows, under a sun and a bluish sky."""
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=60.0)
    bpy.context.object.name, bpy.context.object.is_shadow_catcher = "Floor", True
    bpy.ops.mesh.primitive_cube_add(size=2.4, location=(-0.8, 0.0, 1.21), rotation=(0.0, 0.0, 0.4))
    bpy.context.object.name = "Cube"
    for name in ("Floor", "Cube"):
        scene.objects[name].data.materials.append(new_red())
    bpy.ops.object.light_add(type="SUN", rotation=(0.4, 0.7, 0.0))
    bpy.context.object.name, bpy.context.object.data.energy = "Sun", 2.5
    bpy.ops.object.camera_add(location=(0.0, -7.0, 5.0), rotation=(1.0, 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.2, 0.3, 0.4, 1.0)
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.film_transparent = True
    scene.perfect_bvh.samples, scene.perfect_bvh.use_noise_threshold = SAMPLES, False
    yield scene
    clear_syncs()
    perfect_bvh_addon.unregister()


def render_both(scene: Any) -> tuple[Image, Image]:
    """Return our image and Cycles', (H, W, 4) each."""
    return render_beside(scene, SAMPLES)


def patches(image: Image) -> Image:
    """(H / PATCH, W / PATCH, 4): the mean of each patch."""
    return image.reshape(SIZE[1] // PATCH, PATCH, SIZE[0] // PATCH, PATCH, 4).mean(axis=(1, 3))


def check(scene: Any, most: float = 0.06, mean: float = 0.004) -> Image:
    """Compare our image with Cycles'; return ours. most, mean: the largest and the mean difference of patches."""
    ours, theirs = render_both(scene)
    difference = np.abs(patches(ours) - patches(theirs))
    assert difference.max() < most
    assert difference.mean() < mean
    return ours


def sun_and_sky(scene: Any) -> None: ...


def sky_alone(scene: Any) -> None:
    scene.objects["Sun"].data.energy = 0.0


def sun_alone(scene: Any) -> None:
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0


def over_the_world(scene: Any) -> None:
    scene.render.film_transparent = False


def wall_in_front(scene: Any) -> None:
    """A catcher hides the objects behind it, and catchers cast no shadows on one another."""
    bpy.ops.mesh.primitive_plane_add(size=3.0, location=(1.5, -2.0, 1.5), rotation=(1.57, 0.0, 0.0))
    bpy.context.object.is_shadow_catcher = True
    bpy.context.object.data.materials.append(new_red())


def glass_in_front(scene: Any) -> None:
    bpy.ops.mesh.primitive_plane_add(size=9.0, location=(0.0, -4.0, 2.0), rotation=(1.2, 0.0, 0.0))
    material = new_red("Pane")
    material.node_tree.nodes["Principled BSDF"].inputs["Alpha"].default_value = 0.4
    bpy.context.object.data.materials.append(material)


@pytest.mark.parametrize(
    ("change", "most", "mean"),
    [
        (sun_and_sky, 0.06, 0.004),
        (sky_alone, 0.01, 0.001),
        (sun_alone, 0.01, 0.001),
        (over_the_world, 0.03, 0.004),
        (wall_in_front, 0.08, 0.003),
        (glass_in_front, 0.035, 0.003),
    ],
)
def test_caught_shadows_look_as_in_cycles(scene, change, most: float, mean: float) -> None:
    change(scene)
    check(scene, most, mean)


def test_what_no_shadow_reaches_is_clear_and_without_noise(scene) -> None:
    sun_alone(scene)
    scene.cycles.max_bounces = 0  # light that bounces reaches shadows, too
    image = check(scene, 0.01, 0.001)
    assert (image[..., 3] == 0.0).mean() > 0.1
    dark = (image[..., 3] == 1.0) & ~image[..., :3].any(axis=-1)
    assert dark.mean() > 0.02


def test_a_floor_becomes_a_catcher_and_again_a_floor(scene) -> None:
    floor = scene.objects["Floor"]
    sync = SceneSync()
    sync.update(bpy.context.evaluated_depsgraph_get())
    caught = render_passes(scene, "PERFECT_BVH").combined
    floor.is_shadow_catcher = False
    bpy.context.view_layer.update()
    assert sync.update(bpy.context.evaluated_depsgraph_get()).has_changes
    assert (render_passes(scene, "PERFECT_BVH").combined[..., 3] > 0.999).all()
    floor.is_shadow_catcher = True
    bpy.context.view_layer.update()
    report = sync.update(bpy.context.evaluated_depsgraph_get(), verify=True)
    assert report.has_changes
    assert report.mismatches == ()
    np.testing.assert_array_equal(render_passes(scene, "PERFECT_BVH").combined, caught)
    sync.close()


def test_instances_catch_as_their_instancer_does(scene) -> None:
    floor = scene.objects["Floor"]
    floor.is_shadow_catcher = False
    collection = bpy.data.collections.new("Floors")
    collection.objects.link(floor)
    scene.collection.objects.unlink(floor)
    empty = bpy.data.objects.new("Empty", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    empty.is_shadow_catcher = True
    scene.collection.objects.link(empty)
    image = check(scene)
    assert (image[..., 3] < 0.5).mean() > 0.2
