"""The Preview button without windows: it renders through the camera, keeps the render engine, and reports errors."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh  # noqa: E402
from perfect_bvh_addon.extract.camera import read_camera, read_frame  # noqa: E402
from perfect_bvh_addon.live.sync_cache import syncs_of  # noqa: E402
from perfect_bvh_addon.statistics import last_result  # noqa: E402
from perfect_bvh_addon.view3d.rendered import redraws  # noqa: E402

NAME = "Perfect BVH View"


pytestmark = pytest.mark.usefixtures("registered")


def pixels() -> np.ndarray:
    image = bpy.data.images[NAME]
    values = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)[::-1]


def test_it_renders_without_changing_the_engine(scene, cube) -> None:
    engine = scene.render.engine
    scene.perfect_bvh.use_denoising = False
    assert bpy.ops.perfect_bvh.preview() == {"FINISHED"}
    assert scene.render.engine == engine
    (sync,) = syncs_of(scene)
    *_, (_, passes) = perfect_bvh.render_progressively(
        sync.scene, sync.camera, mode="preview", size=(32, 18), samples=4, appearance=sync.appearance
    )
    raw = pixels()
    np.testing.assert_array_equal(raw, passes["combined"])
    scene.perfect_bvh.use_denoising = True
    bpy.ops.perfect_bvh.preview()
    assert 0.0 < abs(pixels() - raw).mean() < 0.1


def test_it_follows_edits_and_sizes_in_one_image(scene, cube) -> None:
    bpy.ops.perfect_bvh.preview()
    before = pixels()
    cube.location.x = 2.0
    scene.render.resolution_x = 40
    bpy.ops.perfect_bvh.preview()
    assert pixels().shape == (18, 40, 4)
    scene.render.resolution_x = 32
    bpy.ops.perfect_bvh.preview()
    assert abs(pixels() - before).max() > 0.01
    assert [image.name for image in bpy.data.images] == [NAME]


@pytest.mark.parametrize(("mode", "has_scenes_tones"), [("PREVIEW", True), ("NORMAL", False)])
def test_an_editor_shows_it_in_the_tones_of_the_viewport(scene, cube, mode: str, has_scenes_tones: bool) -> None:
    scene.perfect_bvh.mode = mode
    bpy.ops.perfect_bvh.preview()
    assert bpy.data.images[NAME].use_view_as_render == has_scenes_tones


def test_its_size_can_be_less(scene, cube) -> None:
    scene.perfect_bvh.preview_percentage = 50
    bpy.ops.perfect_bvh.preview()
    assert pixels().shape == (9, 16, 4)
    scene.perfect_bvh.preview_percentage = 1
    bpy.ops.perfect_bvh.preview()
    assert pixels().shape == (1, 1, 4)


def test_an_image_of_the_same_name_is_left_alone(scene, cube) -> None:
    mine = bpy.data.images.new(NAME, 4, 4)
    bpy.ops.perfect_bvh.preview()
    assert tuple(mine.size) == (4, 4)
    assert len(bpy.data.images) == 2


def test_distances_are_shown_as_greys(scene, cube) -> None:
    scene.perfect_bvh.mode = "DEPTH"
    bpy.ops.perfect_bvh.preview()
    shown = pixels()[..., :3]
    assert shown.min() >= 0.0 and shown.max() == 1.0


def test_it_says_what_is_missing(scene) -> None:
    with pytest.raises(RuntimeError, match="neither a 3D viewport nor a camera"):
        bpy.ops.perfect_bvh.preview()


# Images of viewports -------------------------------------------------------------------------------------------------


@pytest.fixture
def shading(scene, cube, monkeypatch: pytest.MonkeyPatch):
    """The shading of the only 3D viewport, which looks through the scene's camera and has the picture's size."""
    areas = [area for screen in bpy.data.screens for area in screen.areas if area.type == "VIEW_3D"]
    space = areas[0].spaces.active
    space.region_3d.view_perspective = "CAMERA"
    region = SimpleNamespace(width=32, height=18)
    monkeypatch.setattr(redraws, "find_view", lambda context: (space, region))
    monkeypatch.setattr(redraws, "camera_of", lambda *_: (camera_record(), None))
    scene.render.engine = "PERFECT_BVH"
    kept = (space.shading.type, space.shading.perfect_bvh.mode, space.shading.use_scene_lights_render)
    yield space.shading
    space.shading.type, space.shading.perfect_bvh.mode, space.shading.use_scene_lights_render = kept


def camera_record():
    graph = bpy.context.evaluated_depsgraph_get()
    return read_camera(bpy.context.scene.camera.evaluated_get(graph), read_frame(bpy.context.scene))[0]


def rendered(**settings: object) -> np.ndarray:
    """Render the image with temporary settings of the scene."""
    owner = bpy.context.scene.perfect_bvh
    kept = {name: getattr(owner, name) for name in settings}
    for name, value in settings.items():
        setattr(owner, name, value)
    assert bpy.ops.perfect_bvh.preview() == {"FINISHED"}
    for name, value in kept.items():
        setattr(owner, name, value)
    return pixels()


def test_a_rendered_viewport_is_shown_in_its_own_mode(scene, shading) -> None:
    normals, lit = rendered(mode="NORMAL"), rendered()
    assert abs(normals - lit).max() > 0.1
    shading.perfect_bvh.mode = "NORMAL"
    np.testing.assert_array_equal(rendered(), lit)  # it is in Solid shading
    shading.type = "RENDERED"
    np.testing.assert_array_equal(rendered(), normals)
    scene.render.engine = "BLENDER_WORKBENCH"
    np.testing.assert_array_equal(rendered(), lit)  # another engine renders it


def test_it_is_outdated_by_the_scenes_mode_only_if_it_shows_that(scene, shading) -> None:
    shading.type = "RENDERED"
    rendered()
    assert not last_result.is_outdated(scene)
    scene.perfect_bvh.mode = "CLAY"
    assert last_result.is_outdated(scene)
    shading.perfect_bvh.mode = "NORMAL"
    rendered()
    assert not last_result.is_outdated(scene)
    scene.perfect_bvh.mode = "DEPTH"
    assert not last_result.is_outdated(scene)
    scene.perfect_bvh.samples += 1
    assert last_result.is_outdated(scene)


def test_a_rendered_viewport_is_shown_under_its_own_light(scene, shading) -> None:
    scene.perfect_bvh.use_denoising = False
    light = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    light.data.energy = 5.0
    scene.collection.objects.link(light)
    lit = rendered()
    light.hide_render = light.hide_viewport = True
    dark = rendered()
    light.hide_render = light.hide_viewport = False
    assert lit[..., :3].mean() > dark[..., :3].mean()
    shading.use_scene_lights_render = False
    np.testing.assert_array_equal(rendered(), lit)
    shading.type = "RENDERED"
    np.testing.assert_array_equal(rendered(), dark)


def test_its_image_is_known_to_show_costs(scene, shading) -> None:
    rendered()
    assert last_result.image_mode(bpy.data.images[NAME]) == "preview"
    shading.type, shading.perfect_bvh.mode = "RENDERED", "COST"
    rendered()
    assert last_result.image_mode(bpy.data.images[NAME]) == "cost"
    assert last_result.image_mode(bpy.data.images.new("Other", 4, 4)) is None
