"""Motion blur and the Vector pass as Cycles has them."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

bpy = pytest.importorskip("bpy")

from blender.builders import camera_object  # noqa: E402
from blender.spheres import add_uv_sphere  # noqa: E402
from oracles.cycles import FILTER_WIDTH, preserved, render_beside, render_image, write_multilayer  # noqa: E402
from oracles.exr import read_exr  # noqa: E402

SCENES = Path(__file__).parents[2] / "blend_scenes"
SIZE, PATCH = (96, 54), 6
Image = npt.NDArray[np.float32]


def patches(image: Image) -> Image:
    """(H / PATCH, W / PATCH, 3): the mean colour of each patch; no single bright sample of either counts for many."""
    height, width = image.shape[0] // PATCH, image.shape[1] // PATCH
    bright = np.minimum(image[..., :3], 4.0 * image[..., :3].mean())
    return bright.reshape(height, PATCH, width, PATCH, 3).mean(axis=(1, 3))


def set_size(scene: Any) -> None:
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100


def check_alike(scene: Any, samples: int) -> Image:
    """Check that our image looks like Cycles'; return ours."""
    image, theirs = render_beside(scene, samples)
    ours, expected = patches(image), patches(theirs)
    np.testing.assert_allclose(ours.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), rtol=0.015)
    assert np.abs(ours - expected).mean() < 0.02 * expected.mean()
    return image


@pytest.mark.parametrize("name", ["crowd", "gears"])
def test_an_example_is_blurred_as_in_cycles(registered: None, name: str) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{name}.blend"))
    scene = bpy.context.scene
    set_size(scene)
    scene.frame_set(12)
    render = scene.render
    render.motion_blur_shutter, render.motion_blur_position, render.use_motion_blur = 1.0, "CENTER", True
    blurred = check_alike(scene, 64)
    assert (scene.frame_current, scene.frame_subframe) == (12, 0.0)
    render.use_motion_blur = False
    sharp, _ = render_beside(scene, 64)
    assert np.abs(patches(blurred) - patches(sharp)).max() > 0.003  # there was something to blur


@pytest.fixture
def scene(registered: None) -> Any:
    """A bright cube that flies and turns in front of a wall, and a camera; frame 5 of ten."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    set_size(scene)
    scene.camera = camera_object("camera", lens=35.0)
    scene.camera.location, scene.camera.rotation_euler = (0.0, -8.0, 0.0), (math.radians(90.0), 0.0, 0.0)
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    cube = bpy.context.object
    cube.name = "Cube"
    for frame, x, angle in ((1, -3.0, -1.2), (9, 3.0, 1.2)):
        cube.location.x, cube.rotation_euler.y = x, angle
        cube.keyframe_insert("location", frame=frame)
        cube.keyframe_insert("rotation_euler", frame=frame)
    bpy.ops.mesh.primitive_plane_add(size=30.0, location=(0.0, 4.0, 0.0), rotation=(math.radians(90.0), 0.0, 0.0))
    world = bpy.data.worlds.new("World")
    world.color = (1.0, 1.0, 1.0)
    world.use_nodes = True
    scene.world = world
    bpy.ops.object.light_add(type="SUN", rotation=(0.6, 0.4, 0.0))
    scene.frame_set(5)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    return scene


@pytest.mark.parametrize("position", ["START", "CENTER", "END"])
def test_the_shutter_opens_before_or_after_the_frame(scene: Any, position: str) -> None:
    scene.render.motion_blur_position = position
    check_alike(scene, 64)


def test_the_shutter_opens_as_its_curve_says(scene: Any) -> None:
    mapping = scene.render.motion_blur_shutter_curve
    curve = mapping.curves[0]
    for point, height in zip(curve.points, (0.0, 0.2, 1.0), strict=True):
        point.location.y = height
    mapping.update()
    check_alike(scene, 64)


@pytest.mark.parametrize("duration", [0.0, 0.3])
def test_a_shutter_rolls_down(scene: Any, duration: float) -> None:
    scene.cycles.rolling_shutter_type, scene.cycles.rolling_shutter_duration = "TOP", duration
    check_alike(scene, 64)


def test_a_camera_that_moves_blurs_what_stands_still(scene: Any) -> None:
    camera = scene.camera
    for frame, x, lens in ((1, -2.0, 25.0), (9, 2.0, 50.0)):
        camera.location.x, camera.data.lens = x, lens
        camera.keyframe_insert("location", frame=frame)
        camera.data.keyframe_insert("lens", frame=frame)
    bpy.data.objects["Cube"].animation_data_clear()
    scene.frame_set(5)
    check_alike(scene, 64)


def test_what_is_not_to_be_blurred_is_sharp(scene: Any) -> None:
    bpy.data.objects["Cube"].cycles.use_motion_blur = False
    image = check_alike(scene, 64)
    scene.render.use_motion_blur = False
    sharp, _ = render_beside(scene, 64)
    assert np.allclose(image, sharp, atol=1e-5)


def test_a_shutter_of_no_time_blurs_nothing(scene: Any) -> None:
    scene.render.motion_blur_shutter = 0.0
    image, _ = render_beside(scene, 16)
    scene.render.use_motion_blur = False
    sharp, _ = render_beside(scene, 16)
    assert np.array_equal(image, sharp)


def test_a_view_layer_may_be_without(scene: Any) -> None:
    scene.view_layers[0].use_motion_blur = False
    check_alike(scene, 64)


# Vectors -------------------------------------------------------------------------------------------------------------


def vectors(scene: Any, engine: str) -> Image:
    """Return the Vector pass, (H, W, 4), row 0 on top."""
    layer, cycles = scene.view_layers[0], scene.cycles
    with preserved(
        (layer, "use_pass_vector", True),
        (scene.render, "use_motion_blur", False),
        (cycles, "samples", 1),
        (cycles, "use_adaptive_sampling", False),
        (cycles, "use_denoising", False),
        (cycles, "filter_width", FILTER_WIDTH),
        (cycles, "max_bounces", 0),
        (scene.perfect_bvh, "samples", 1),
    ):
        return render_image(scene, engine, "Vector", "XYZW")


def check_vectors(scene: Any, moving_share: float) -> None:
    ours, theirs = vectors(scene, "PERFECT_BVH"), vectors(scene, "CYCLES")
    assert (np.abs(theirs).max(axis=-1) > 0.1).mean() > moving_share
    # At an edge Cycles' ray, which is up to .005 pixels off, may hit the surface behind.
    off = np.abs(ours - theirs).max(axis=-1) > 0.01
    assert off.mean() < 0.005, np.argwhere(off)[:10]


def test_vectors_are_those_of_cycles(scene: Any) -> None:
    check_vectors(scene, 0.02)


def test_vectors_tell_of_the_camera(scene: Any) -> None:
    camera = scene.camera
    for frame, x, angle in ((1, -2.0, -0.1), (9, 2.0, 0.1)):
        camera.location.x, camera.rotation_euler.z = x, angle
        camera.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_set(5)
    check_vectors(scene, 0.9)


def test_vectors_of_an_example_are_those_of_cycles(registered: None) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(SCENES / "gears.blend"))
    scene = bpy.context.scene
    set_size(scene)
    scene.frame_set(12)
    check_vectors(scene, 0.1)


def move_camera(scene: Any, move: str) -> None:
    """Set a key at frames 1 and 9 each; the wall does not move."""
    camera = scene.camera
    bpy.data.objects["Cube"].animation_data_clear()
    bpy.data.objects["Cube"].hide_render = True
    for frame, to in ((1, -1.0), (9, 1.0)):
        if move == "sideways":
            camera.location.x = to
        elif move == "forwards":
            camera.location.y = -8.0 + to
        else:
            camera.data.ortho_scale = 6.0 + to
        camera.keyframe_insert("location", frame=frame)
        camera.data.keyframe_insert("ortho_scale", frame=frame)
    scene.frame_set(5)


@pytest.mark.parametrize("move", ["sideways", "forwards", "wider"])
def test_vectors_of_orthographic_cameras_are_exact(scene: Any, move: str) -> None:
    """Cycles projects them as if the moving camera had a perspective, and ignores a change of scale."""
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 6.0
    move_camera(scene, move)
    width, height = SIZE
    x, y = np.meshgrid((np.arange(width) + 0.5 - width / 2), (height / 2 - np.arange(height) - 0.5))
    pixels = np.stack([x, y], axis=-1)
    at_frames = []
    for frame in (4, 5, 6):
        scene.frame_set(frame)
        at_frames.append((scene.camera.location.x, width / scene.camera.data.ortho_scale))
    scene.frame_set(5)
    here_x, here_scale = at_frames[1]
    points = pixels / here_scale + [here_x, 0.0]
    # The wall's points in frames 4, 5, 6, in pixels to the right and up from the image's centre.
    places = [(points - [where, 0.0]) * scale for where, scale in at_frames]
    expected = np.concatenate([places[0] - places[1], places[1] - places[2]], axis=-1)
    np.testing.assert_allclose(vectors(scene, "PERFECT_BVH"), expected, atol=1e-3)
    assert (np.abs(expected).max() > 0.1) == (move != "forwards")


def test_vectors_take_the_short_way_over_the_seam_of_a_panorama(scene: Any) -> None:
    """There Cycles' vectors go once round the whole image."""
    data = scene.camera.data
    data.type = "PANO"
    if hasattr(data, "panorama_type"):
        data.panorama_type = "EQUIRECTANGULAR"
    else:
        data.cycles.panorama_type = "EQUIRECTANGULAR"
    bpy.data.objects["Cube"].hide_render = True
    add_uv_sphere(radius=50.0, location=scene.camera.location)  # seen all round
    turns = {}
    for frame, angle in ((1, -0.2), (9, 0.2)):
        scene.camera.rotation_euler.z = angle
        scene.camera.keyframe_insert("rotation_euler", frame=frame)
    for frame in (4, 5, 6):
        scene.frame_set(frame)
        turns[frame] = scene.camera.rotation_euler.z
    scene.frame_set(5)
    pixels = SIZE[0] / (2.0 * math.pi)
    expected = [(turns[4] - turns[5]) * pixels, 0.0, (turns[5] - turns[6]) * pixels, 0.0]
    found = vectors(scene, "PERFECT_BVH")
    assert abs(expected[0]) > 0.5
    seen = np.abs(found).max(axis=-1) > 0.0  # without the wall, which is another surface
    np.testing.assert_allclose(found[:, [0, 1, -2, -1]], np.broadcast_to(expected, (SIZE[1], 4, 4)), atol=1e-3)
    np.testing.assert_allclose(found[seen], np.broadcast_to(expected, found[seen].shape), atol=1e-3)


def test_with_motion_blur_there_are_no_vectors(scene: Any) -> None:
    """As in Cycles: a blurred image must not be blurred again."""
    layer = scene.view_layers[0]
    layer.use_pass_vector = True
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "blurred.exr"
        write_multilayer(path, scene, "PERFECT_BVH")
        assert not any(".Vector." in name for name in read_exr(path))
