"""When a synced scene refuses to answer, when it answers again, and its state after a failed update."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import perfect_bvh
import pytest
from blender.builders import (
    SQUARE,
    evaluated,
    mesh_data,
    mesh_object,
)
from blender.syncing import DOWN, assert_stale, cast_down, height
from perfect_bvh import StaleSceneError
from perfect_bvh_addon import SceneSync


def test_nothing_is_answered_before_the_first_update(scene: Any) -> None:
    sync = SceneSync()
    assert_stale(sync, r"nothing was synced yet: call update\(\)")
    with pytest.raises(StaleSceneError, match="nothing was synced yet"):
        _ = sync.camera
    with pytest.raises(StaleSceneError, match="nothing was synced yet"):
        sync.describe([0])


def test_an_evaluation_makes_the_scene_stale_until_the_next_update(scene: Any) -> None:
    obj = mesh_object("a", mesh_data("a", *SQUARE))
    sync = SceneSync()
    sync.update(evaluated())
    obj.location.z = 1.0
    depsgraph = evaluated()
    assert_stale(sync, r"evaluated again since the last update: call update\(\)")
    sync.update(depsgraph)
    assert height(sync) == 1.0


def test_asking_for_an_up_to_date_depsgraph_is_no_change(scene: Any) -> None:
    mesh_object("a", mesh_data("a", *SQUARE))
    sync = SceneSync()
    sync.update(evaluated())
    bpy.context.evaluated_depsgraph_get().update()
    assert height(sync) == 0.0


def test_a_frame_change_makes_it_stale(scene: Any) -> None:
    obj = mesh_object("a", mesh_data("a", *SQUARE))
    for frame, z in ((1, 0.0), (11, 5.0)):
        obj.location.z = z
        obj.keyframe_insert("location", frame=frame)
    sync = SceneSync()
    for frame in (1, 11):
        scene.frame_set(frame)
        with pytest.raises(StaleSceneError):
            cast_down(sync)
        sync.update(bpy.context.evaluated_depsgraph_get())
        assert height(sync) == pytest.approx({1: 0.0, 11: 5.0}[frame])


def test_undo_and_redo_make_it_stale_and_keep_ids(scene: Any) -> None:
    mesh_object("a", mesh_data("a", *SQUARE))
    bpy.ops.ed.undo_push(message="before")
    bpy.data.objects["a"].location.z = 1.0
    bpy.ops.ed.undo_push(message="moved")
    sync = SceneSync()
    sync.update(evaluated())
    first = cast_down(sync).instance_ids.tolist()
    for step, expected in ((bpy.ops.ed.undo, 0.0), (bpy.ops.ed.redo, 1.0)):
        step()
        assert_stale(sync, r"call update\(\)")
        report = sync.update(evaluated())
        assert height(sync) == expected
        assert cast_down(sync).instance_ids.tolist() == first
        assert report.count_meshes("kept") == 1


def test_another_file_makes_it_stale_and_can_be_synced(scene: Any, tmp_path: Path) -> None:
    mesh_object("a", mesh_data("a", *SQUARE), location=(0, 0, 2))
    path = str(tmp_path / "two.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.data.objects["a"].location.z = 5.0
    sync = SceneSync()
    sync.update(evaluated())
    assert height(sync) == 5.0
    bpy.ops.wm.open_mainfile(filepath=path)
    assert_stale(sync, "another file was loaded|evaluated again")
    sync.update(evaluated())
    assert height(sync) == 2.0
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert_stale(sync, r"call update\(\)")


def test_a_render_sync_does_not_go_stale(scene: Any) -> None:
    obj = mesh_object("a", mesh_data("a", *SQUARE))
    sync = SceneSync(watch=False)
    sync.update(evaluated())
    obj.location.z = 1.0
    evaluated()
    assert height(sync) == 0.0


def test_snapshots_go_on_answering(scene: Any) -> None:
    obj = mesh_object("a", mesh_data("a", *SQUARE))
    sync = SceneSync()
    sync.update(evaluated())
    snapshot = sync.scene.snapshot()
    obj.location.z = 1.0
    sync.update(evaluated())
    assert snapshot.cast_rays([(0, 0, 10)], [DOWN]).t_hit[0] == 10.0
    assert height(sync) == 1.0


def test_snapshots_may_be_traced_while_the_next_frame_is_synced(scene: Any) -> None:
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=100, y_subdivisions=100)
    obj = bpy.context.object
    sync = SceneSync()
    sync.update(evaluated())
    snapshot = sync.scene.snapshot()
    origins = np.column_stack([np.linspace(-0.9, 0.9, 5000), np.full(5000, 0.1), np.full(5000, 10.0)])
    wrong: list[int] = []
    done = threading.Event()

    def trace() -> None:
        while not (done.is_set() and wrong):
            wrong.append(int((snapshot.cast_rays(origins, [DOWN]).t_hit != 10.0).sum()))

    tracer = threading.Thread(target=trace)
    tracer.start()
    for step in range(8):
        points = np.empty(len(obj.data.vertices) * 3, np.float32)
        obj.data.vertices.foreach_get("co", points)
        points[2::3] = 0.1 * step
        obj.data.vertices.foreach_set("co", points)
        obj.data.update()
        sync.update(evaluated())
    done.set()
    tracer.join()
    assert not any(wrong)
    assert height(sync) == pytest.approx(0.7)


# Failures ------------------------------------------------------------------------------------------------------------


def test_a_cancelled_update_raises_until_the_next_one(scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    obj = mesh_object("a", mesh_data("a", *SQUARE))
    sync = SceneSync()
    sync.update(evaluated())
    obj.location.z = 3.0
    other = mesh_object("b", mesh_data("b", *SQUARE), location=(8, 0, 0))
    depsgraph = evaluated()
    with monkeypatch.context() as patch:
        patch.setattr(perfect_bvh.Scene, "commit", cancelled)
        with pytest.raises(perfect_bvh.Cancelled):
            sync.update(depsgraph)
        assert_stale(sync, "the last update did not succeed")
    bpy.data.objects.remove(other)
    report = sync.update(evaluated())
    assert report.finishes_earlier_update
    assert height(sync) == 3.0
    assert not cast_down(sync, 8.2).is_hit.any()


def cancelled(*_: Any, **__: Any) -> Any:
    raise perfect_bvh.Cancelled("stopped")


def test_a_build_that_is_stopped_half_way_is_finished_by_the_next_update(scene: Any) -> None:
    """How far the engine gets before it asks depends on the machine; the result of the next update must not."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=400, y_subdivisions=400)
    sync = SceneSync()
    stopped = False
    try:
        sync.update(evaluated(), progress=lambda share: False)
    except perfect_bvh.Cancelled:
        stopped = True
    assert sync.scene.is_current != stopped
    sync.update(evaluated())
    assert height(sync) == 0.0


def test_the_number_of_rays_reaches_the_engine(scene: Any) -> None:
    mesh_object("a", mesh_data("a", *SQUARE))
    sync = SceneSync()
    assert sync.update(evaluated(), expected_rays=1_000_000).added_count == 1
    with pytest.raises(ValueError, match="commit: expected_rays must be a number from 0 to 1e\\+18, got -1"):
        sync.update(evaluated(), expected_rays=-1)
    assert_stale(sync, "the last update did not succeed")


def test_an_error_while_reading_leaves_the_scene_stale(scene: Any) -> None:
    mesh_object("a", mesh_data("a", *SQUARE))
    sync = SceneSync()
    sync.update(evaluated())
    with pytest.raises(AttributeError):
        sync.update(None)
    assert_stale(sync, "the last update did not succeed")
    sync.update(evaluated())
    assert height(sync) == 0.0
