"""Cameras that move, zoom and focus within a shutter."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import camera_object, evaluated, mesh_object
from blender.moving_scenes import FRAME, SHUTTER, at_frame, keyed
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.sync.records import CameraRecord


@pytest.fixture
def camera(scene: Any) -> Any:
    made = camera_object()
    mesh_object("a")
    scene.frame_set(FRAME)
    return made


def read(**how: Any) -> SceneSync:
    sync = SceneSync()
    sync.update(evaluated(), shutter=SHUTTER, **how)
    return sync


def assert_same(first: Any, second: Any) -> None:
    np.testing.assert_array_equal(first.matrix, second.matrix)
    assert replace(first, matrix=second.matrix) == second


def test_a_camera_that_rests_has_no_motion(camera: Any) -> None:
    sync = read()
    assert sync.camera is not None and sync.camera_motion == ()


@pytest.mark.parametrize("what", ["moves", "zooms", "focuses", "grows"])
def test_its_moments_are_those_of_the_scene_there(camera: Any, what: str) -> None:
    if what == "moves":
        keyed(camera, "location", [(0.0, 0.0, 5.0), (3.0, 0.0, 9.0)])
        keyed(camera, "rotation_euler", [(0.0, 0.0, 0.0), (1.0, 2.0, 0.0)])
    elif what == "zooms":
        keyed(camera.data, "lens", [20.0, 90.0])
    elif what == "focuses":
        camera.data.dof.use_dof = True
        camera.data.dof.focus_distance = 1.0
        camera.data.keyframe_insert("dof.focus_distance", frame=1)
        camera.data.dof.focus_distance = 9.0
        camera.data.keyframe_insert("dof.focus_distance", frame=21)
    else:
        camera.data.type = "ORTHO"
        keyed(camera.data, "ortho_scale", [2.0, 9.0])
    bpy.context.scene.frame_set(FRAME)
    sync = read(steps=5)
    assert len(sync.camera_motion) == 5
    moments, own = sync.camera_motion, sync.camera
    for camera_there, time in zip(moments, np.linspace(*SHUTTER, 5), strict=True):
        assert_same(camera_there, at_frame(float(time)).camera)
    assert_same(moments[2], own)
    with pytest.raises(AssertionError):
        assert_same(moments[0], moments[4])


def test_its_motion_goes_with_the_shutter(camera: Any) -> None:
    keyed(camera, "location", [(0.0, 0.0, 5.0), (3.0, 0.0, 9.0)])
    bpy.context.scene.frame_set(FRAME)
    sync = read()
    assert len(sync.camera_motion) == 3
    revision = sync.revision
    assert not sync.update(evaluated(), shutter=SHUTTER).camera_changed and sync.revision == revision
    report = sync.update(evaluated())
    assert report.camera_changed and sync.camera_motion == () and sync.revision == revision + 1


def test_its_own_switch_and_steps_count(camera: Any) -> None:
    keyed(camera, "location", [(0.0, 0.0, 5.0), (3.0, 0.0, 9.0)])
    camera.cycles.motion_steps = 3
    bpy.context.scene.frame_set(FRAME)
    assert len(read().camera_motion) == 9
    camera.cycles.use_motion_blur = False
    assert read().camera_motion == ()


def test_another_camera_may_look(camera: Any) -> None:
    other = camera_object("other")
    bpy.context.scene.camera = camera
    keyed(other, "location", [(0.0, 0.0, 5.0), (3.0, 0.0, 9.0)])
    bpy.context.scene.frame_set(FRAME)
    assert read().camera_motion == ()
    assert len(read(camera=other).camera_motion) == 3
    still = read(camera=other).record.camera
    assert read(camera=still).camera_motion == (), "a record does not move"


def test_a_function_is_asked_at_each_moment(camera: Any) -> None:
    """An engine does so for each eye of a stereo pair."""
    keyed(camera, "location", [(0.0, 0.0, 5.0), (3.0, 0.0, 9.0)])
    bpy.context.scene.frame_set(FRAME)
    base = read().record.camera
    asked: list[float] = []

    def eye(depsgraph: Any) -> CameraRecord:
        asked.append(depsgraph.scene.frame_current_final)
        matrix = np.array(camera.evaluated_get(depsgraph).matrix_world, np.float64)
        matrix[0, 3] += 100.0
        return replace(base, matrix=matrix)

    sync = read(camera=eye)
    assert asked == [10.0, 9.75, 10.25, 10.0]
    assert [round(moment.matrix[0, 3], 4) for moment in sync.camera_motion] == [101.3125, 101.35, 101.3875]


def test_a_marker_s_cut_does_not_jump_within_a_frame(camera: Any) -> None:
    """As in Cycles, the frame's own camera is used during the whole shutter."""
    other = camera_object("other")
    other.location.x = 50.0
    scene = bpy.context.scene
    scene.timeline_markers.new("one", frame=1).camera = camera
    scene.timeline_markers.new("two", frame=FRAME + 1).camera = other
    scene.frame_set(FRAME)
    sync = SceneSync()
    sync.update(evaluated(), shutter=(0.0, 2.0))
    assert sync.camera_motion == () and scene.camera == camera


def test_what_cannot_be_followed_is_named(camera: Any) -> None:
    keyed(camera.data, "type", ["PERSP", "ORTHO"], (FRAME, FRAME + 1))
    bpy.context.scene.frame_set(FRAME)
    sync = SceneSync()
    sync.update(evaluated(), shutter=(0.0, 1.0))
    assert sync.camera_motion == () and sync.camera is not None
    assert sync.warnings == (
        "camera: its motion is unsupported, because it cannot be followed through the shutter: its type "
        "changes; it stands still, as at the frame",
    )
    keyed(camera, "scale", [(1.0, 1.0, 1.0), (0.0, 0.0, 0.0)], (FRAME, FRAME + 1))
    camera.data.animation_data_clear()
    bpy.context.scene.frame_set(FRAME)
    sync.update(evaluated(), shutter=(0.0, 1.0))
    assert sync.camera_motion == () and "an axis is scaled to zero" in sync.warnings[0]
