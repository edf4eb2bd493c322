"""The order of a frame is: set it, evaluate, sync, cast. Changes of the image show, and cause no other work."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import perfect_bvh
import pytest
from blender.builders import SQUARE, camera_object, evaluated, mesh_data, mesh_object
from blender.syncing import assert_stale, height
from perfect_bvh_addon import SceneSync


def test_each_frame_is_that_frame_and_none_is_one_late(scene: Any) -> None:
    """One square is at the height of the frame's number by keyframes, and the vertices of another one are."""
    moved = mesh_object("moved", mesh_data("moved", *SQUARE))
    bent = mesh_object("bent", mesh_data("bent", *SQUARE), location=(5, 0, 0))
    bent.shape_key_add(name="Basis")
    key = bent.shape_key_add(name="up")
    for point in key.data:
        point.co.z = 10.0
    for frame in range(11):
        moved.location.z, key.value = frame, frame / 10
        moved.keyframe_insert("location", frame=frame)
        key.keyframe_insert("value", frame=frame)
    sync = SceneSync()
    for frame in (3, 4, 5, 9, 2, 2, 8):
        scene.frame_set(frame)
        assert_stale(sync, r"call update\(\)")
        report = sync.update(bpy.context.evaluated_depsgraph_get())
        assert report.frame == frame
        assert (height(sync), height(sync, 5.2)) == pytest.approx((frame, frame), abs=1e-4)
    sync.close()


def test_a_frame_set_within_a_handler_is_seen(scene: Any) -> None:
    """Another add-on's handler moves objects again after the frame was evaluated."""
    obj = mesh_object("a", mesh_data("a", *SQUARE))

    def follow(changed: Any, *_: Any) -> None:
        obj.location.z = 0.5 * changed.frame_current

    bpy.app.handlers.frame_change_pre.append(follow)
    sync = SceneSync()
    try:
        for frame in (4, 9, 2):
            scene.frame_set(frame)
            sync.update(bpy.context.evaluated_depsgraph_get())
            assert height(sync) == 0.5 * frame
    finally:
        bpy.app.handlers.frame_change_pre.remove(follow)
        sync.close()


def image(sync: SceneSync, mode: str) -> np.ndarray:
    assert sync.camera is not None
    made = perfect_bvh.render(sync.scene, sync.camera, mode=mode, size=(16, 9), appearance=sync.appearance)
    return np.asarray(made)


def paint() -> None:
    bpy.data.materials["paint"].diffuse_color = (0.1, 0.9, 0.2, 1.0)


def other_material() -> None:
    other = bpy.data.materials.new("other")
    other.diffuse_color = (0.9, 0.1, 0.1, 1.0)
    bpy.data.objects["a"].material_slots[0].material = other


def look_from_elsewhere() -> None:
    bpy.context.scene.camera.location.x += 0.3


def zoom() -> None:
    bpy.context.scene.camera.data.lens = 90.0


def hide() -> None:
    bpy.data.objects["a"].hide_viewport = True


def hide_from_the_camera() -> None:
    bpy.data.objects["a"].visible_camera = False


def clear_film() -> None:
    bpy.context.scene.render.film_transparent = True


LOOKS = (paint, other_material, look_from_elsewhere, zoom, hide, hide_from_the_camera, clear_film)


@pytest.mark.parametrize("change", LOOKS, ids=lambda change: change.__name__)
def test_what_changes_the_image_shows_and_builds_no_mesh(scene: Any, change: Callable[[], None]) -> None:
    obj = mesh_object("a", mesh_data("a", *SQUARE))
    obj.data.materials.append(bpy.data.materials.new("paint"))
    camera_object().location = (0.5, 0.5, 3.0)
    sync = SceneSync()
    sync.update(evaluated())
    before = image(sync, "clay")
    change()
    report = sync.update(evaluated(), verify=True)
    assert report.mismatches == ()
    assert report.commit.count("built") + report.commit.count("rebuilt") + report.commit.count("refitted") == 0
    assert not np.array_equal(image(sync, "clay"), before)
    fresh = SceneSync()
    fresh.update(evaluated())
    np.testing.assert_array_equal(image(sync, "clay"), image(fresh, "clay"))
    for one in (sync, fresh):
        one.close()
