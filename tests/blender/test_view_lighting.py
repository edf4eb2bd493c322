"""Rendered viewports without the scene's lights, and with a studio light in place of its world."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import perfect_bvh
import pytest

bpy = pytest.importorskip("bpy")

from perfect_bvh_addon import SceneSync  # noqa: E402
from perfect_bvh_addon.settings.shading_settings import read_view_settings  # noqa: E402
from perfect_bvh_addon.sync.records import AttributeRequest  # noqa: E402
from perfect_bvh_addon.view3d.rendered import view_lighting  # noqa: E402
from perfect_bvh_addon.view3d.rendered import view_lighting as studio_images  # noqa: E402
from wine_gaps import plain_files  # noqa: E402

ATTRIBUTES = AttributeRequest(corner_normals=True, shading=True)


@pytest.fixture(autouse=True)
def shading(registered: None) -> Any:
    """The shading of a viewport with the scene's light. The scene: a cube, a camera above, a lamp, a bluish world."""
    bpy.ops.wm.read_factory_settings()
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 48, 32
    world = scene.world
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.1, 0.2, 0.4, 1.0)
    world.color = (0.5, 0.25, 0.125)
    areas = [area for screen in bpy.data.screens for area in screen.areas if area.type == "VIEW_3D"]
    shading = areas[0].spaces.active.shading
    shading.type = "RENDERED"
    return shading


def image(shading: Any, mode: str = "preview") -> Any:
    """Render (H, W, 3), the image of a viewport that looks through the scene's camera."""
    sync = SceneSync(ATTRIBUTES)
    sync.update(bpy.context.evaluated_depsgraph_get())
    lighting = view_lighting.lighting_of(shading, bpy.context.scene)
    lit = lighting.light(sync.appearance, sync.record.lights.of_world)
    made = perfect_bvh.render(sync.scene, sync.camera, mode, sync.size, 32, appearance=lit)
    sync.close()
    return made[..., :3]


def load(shading: Any) -> None:
    """Do the work of a timer; without a window there are none."""
    studio_images._load(shading.selected_studio_light.path)


def turn_world(path: str, angle: float) -> None:
    """Show the image of a file in the scene's own world, turned as a studio light is."""
    tree = bpy.context.scene.world.node_tree
    texture, mapping, place = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexEnvironment", "Mapping", "TexCoord")
    )
    texture.image = bpy.data.images.load(path)
    mapping.inputs["Rotation"].default_value[2] = angle
    tree.links.new(place.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])


def test_lamps_can_be_left_out(shading: Any) -> None:
    with_lamps = image(shading)
    shading.use_scene_lights_render = False
    without = image(shading)
    assert with_lamps.mean() > without.mean()
    bpy.data.objects.remove(bpy.data.objects["Light"])
    np.testing.assert_array_equal(image(shading), without)


@plain_files
def test_a_studio_light_stands_for_the_world_as_an_image_of_the_world_would(shading: Any) -> None:
    shading.use_scene_world_render, shading.studio_light = False, "courtyard.exr"
    shading.studiolight_rotate_z, shading.studiolight_background_alpha = 1.0, 1.0
    load(shading)
    studio = image(shading)
    turn_world(shading.selected_studio_light.path, 1.0)
    shading.use_scene_world_render = True
    own = image(shading)
    assert np.ptp(own) > 0.1
    np.testing.assert_allclose(studio, own, rtol=1e-4, atol=1e-4)
    shading.use_scene_world_render, shading.studiolight_rotate_z = False, -1.0
    assert np.abs(image(shading) - own).mean() > 0.01


@plain_files
def test_behind_the_scene_is_the_worlds_color_as_far_as_the_studio_is_not(shading: Any) -> None:
    shading.use_scene_world_render, shading.use_scene_lights_render = False, False
    load(shading)
    shading.studiolight_background_alpha, shading.studiolight_intensity = 0.0, 2.0
    plain = image(shading)
    np.testing.assert_allclose(plain[0, 0], (0.5, 0.25, 0.125), rtol=1e-5)
    shading.studiolight_background_alpha = 1.0
    whole = image(shading)
    shading.studiolight_background_alpha = 0.25
    np.testing.assert_allclose(image(shading)[0, 0], 0.75 * plain[0, 0] + 0.25 * whole[0, 0], rtol=1e-3)
    shading.studiolight_intensity = 1.0
    assert image(shading).mean() < whole.mean()


@plain_files
def test_grey_shines_until_the_studio_light_is_loaded(shading: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(studio_images, "_loaded", {})
    monkeypatch.setattr(studio_images, "_asked", set())
    monkeypatch.setattr(bpy.app.timers, "register", lambda load, **_: asked.append(load))
    shading.use_scene_world_render, shading.studiolight_background_alpha = False, 1.0
    grey = image(shading)
    np.testing.assert_allclose(grey[0, 0], view_lighting.GREY, rtol=1e-5)
    before = view_lighting.lighting_of(shading, bpy.context.scene)
    assert before == view_lighting.lighting_of(shading, bpy.context.scene)
    (load_now,) = asked
    names = [one.name for one in bpy.data.images]
    load_now()
    assert [one.name for one in bpy.data.images] == names
    assert view_lighting.lighting_of(shading, bpy.context.scene) != before
    assert np.abs(image(shading) - grey).mean() > 0.01 and len(asked) == 1


@plain_files
def test_the_sun_of_a_sky_belongs_to_the_world(shading: Any) -> None:
    bpy.data.objects.remove(bpy.data.objects["Light"])
    tree = bpy.context.scene.world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sky_type = sky.bl_rna.properties["sky_type"].enum_items[-1].identifier
    sky.sun_elevation = math.radians(40.0)
    tree.links.new(sky.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    all_light = image(shading)
    shading.use_scene_lights_render = False
    np.testing.assert_array_equal(image(shading), all_light)
    shading.use_scene_world_render, shading.use_scene_lights_render = False, True
    load(shading)
    with_lights = image(shading)
    shading.use_scene_lights_render = False
    np.testing.assert_array_equal(image(shading), with_lights)


def test_modes_without_light_are_as_they_were(shading: Any) -> None:
    before = image(shading, "normal")
    shading.use_scene_lights_render = shading.use_scene_world_render = False
    np.testing.assert_array_equal(image(shading, "normal"), before)


def test_a_viewport_may_show_another_mode_than_a_render(shading: Any) -> None:
    scene = bpy.context.scene
    scene.perfect_bvh.mode = "CLAY"
    assert read_view_settings(scene, shading).mode == "clay"
    shading.perfect_bvh.mode = "DEPTH"
    assert read_view_settings(scene, shading).mode == "depth"
    assert scene.perfect_bvh.mode == "CLAY"
    numbers = [item.value for item in shading.perfect_bvh.bl_rna.properties["mode"].enum_items]
    assert len(set(numbers)) == len(numbers)
