"""The Preview button without windows: it renders through the camera, leaves the render engine alone, and says no."""

from __future__ import annotations

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh  # noqa: E402
from perfect_bvh_addon.live.sync_cache import syncs_of  # noqa: E402

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
