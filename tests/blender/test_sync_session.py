"""`SceneSync` as a script uses it: stale scenes, answers against Blender's own, failures, sessions, handlers."""

from __future__ import annotations

import gc
import threading
import weakref
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import perfect_bvh
import pytest
from blender.builders import (
    SQUARE,
    camera_object,
    collection,
    collection_instance,
    evaluated,
    in_render,
    instances_on_grid,
    made_cube,
    mesh_data,
    mesh_object,
)
from perfect_bvh import StaleSceneError
from perfect_bvh_addon import AttributeRequest, SceneSync, handlers
from perfect_bvh_addon.extract import changes
from perfect_bvh_addon.session import clear_sessions, session_of, sessions_of

DOWN = (0.0, 0.0, -1.0)


def cast_down(sync: SceneSync, x: float = 0.2, y: float = 0.2) -> Any:
    return sync.scene.cast_rays([(x, y, 10.0)], [DOWN])


def height(sync: SceneSync, x: float = 0.2, y: float = 0.2) -> float:
    return 10.0 - float(cast_down(sync, x, y).t_hit[0])


def installed() -> int:
    """How many of the add-on's functions Blender would call."""
    return sum(handler in getattr(bpy.app.handlers, name) for name, handler in changes._HANDLERS)


# Answers -------------------------------------------------------------------------------------------------------------


def test_hits_are_those_of_blenders_own_ray_cast(scene: Any, rng: np.random.Generator) -> None:
    bpy.ops.mesh.primitive_monkey_add(rotation=(0.4, 0.3, 0.2))
    bpy.ops.mesh.primitive_torus_add(location=(2.5, 0, 0))
    bpy.context.object.scale = (1, -1.5, 0.7)
    inner = collection("inner", linked=False)
    mesh_object("leaf", collection=inner)
    collection_instance("tree", inner, location=(-2.5, 0, 0)).rotation_euler.x = 1.0
    instances_on_grid("field", made_cube, 3).location.y = 8.0
    depsgraph = evaluated()
    sync = SceneSync()
    sync.update(depsgraph)
    origins = rng.uniform((-5, -3, 4), (5, 13, 6), (1000, 3))
    directions = rng.uniform((-0.3, -0.3, -1), (0.3, 0.3, -0.9), (1000, 3))
    hits = sync.scene.cast_rays(origins, directions, fields=("instance_ids", "mesh_ids", "primitive_ids", "positions"))
    names = sync.describe(hits.instance_ids).names
    polygons = sync.polygon_ids(hits)
    for row, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        found, location, _, polygon, obj, _ = scene.ray_cast(depsgraph, origin, direction)
        assert bool(hits.is_hit[row]) == found
        if found:
            np.testing.assert_allclose(hits.positions[row], location, atol=1e-4)
            assert (names[row], polygons[row]) == (obj.name, polygon)
    assert hits.is_hit.sum() > 60


def test_materials_of_hits(scene: Any) -> None:
    data = mesh_data("two halves", [(-1, -1, 0), (0, -1, 0), (1, -1, 0), (-1, 1, 0), (0, 1, 0), (1, 1, 0)],
                     [(0, 1, 4, 3), (1, 2, 5, 4)])  # fmt: skip
    for name in ("red", "green"):
        data.materials.append(bpy.data.materials.new(name))
    data.polygons[1].material_index = 1
    mesh_object("halves", data)
    sync = SceneSync()
    sync.update(evaluated())
    hits = sync.scene.cast_rays([(-0.5, 0, 5), (0.5, 0, 5), (3, 0, 5)], [DOWN])
    rows = sync.material_ids(hits)
    assert rows[2] == -1
    assert sync.material_names[rows[:2]].tolist() == ["red", "green"]
    assert sync.polygon_ids(hits).tolist() == [0, 1, -1]


def test_dropped_triangles_leave_the_others_their_ids(scene: Any) -> None:
    mesh_object(
        "broken", mesh_data("broken", [(0, 0, np.nan), (0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2), (1, 2, 3)])
    )
    sync = SceneSync()
    report = sync.update(evaluated())
    hits = cast_down(sync)
    assert hits.primitive_ids.tolist() == [0]
    assert sync.polygon_ids(hits).tolist() == sync.triangle_ids(hits).tolist() == [1]
    assert (
        report.warnings
        == sync.warnings
        == ("broken: 1 triangles with a vertex that is not finite or beyond 1e18 were left out",)
    )


def test_a_mesh_with_nothing_left_is_synced(scene: Any) -> None:
    mesh_object("lost", mesh_data("lost", [(0, 0, np.nan), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]))
    sync = SceneSync()
    sync.update(evaluated())
    assert not cast_down(sync).is_hit.any()


def test_an_empty_scene_answers_with_misses(scene: Any) -> None:
    sync = SceneSync()
    report = sync.update(evaluated())
    hits = cast_down(sync)
    assert not hits.is_hit.any()
    assert sync.describe(hits.instance_ids).names.tolist() == [""]
    assert sync.camera is None
    assert sync.size == (32, 18)
    assert report.objects == ()


def test_equal_distances_are_settled_alike_whatever_the_history(scene: Any) -> None:
    """Two objects in one place: which is hit must not depend on which was synced first."""
    for name in ("one", "two", "three"):
        mesh_object(name, mesh_data(name, *SQUARE))
    sync = SceneSync()
    sync.update(evaluated())
    for hidden in ("one", "three", "two", "one"):
        bpy.data.objects[hidden].hide_viewport = True
        sync.update(evaluated())
        bpy.data.objects[hidden].hide_viewport = False
        sync.update(evaluated())
        fresh = SceneSync()
        fresh.update(evaluated())
        answers = [item.describe(cast_down(item).instance_ids).names[0] for item in (sync, fresh)]
        assert answers == ["one", "one"]


def test_the_camera_is_the_engines(scene: Any) -> None:
    camera_object(shift_x=0.1).location.z = 4.0
    sync = SceneSync()
    sync.update(evaluated())
    assert isinstance(sync.camera, perfect_bvh.Camera)
    assert sync.camera.matrix[2, 3] == 4.0
    assert sync.camera.window == sync.record.camera.window


def test_more_attributes_can_be_requested(scene: Any) -> None:
    bpy.ops.mesh.primitive_monkey_add()
    bpy.ops.object.shade_smooth()
    sync = SceneSync(AttributeRequest(material_slots=False))
    sync.update(evaluated())
    (before,) = sync.appearance.meshes.values()
    assert (before.corner_normals, before.material_slots) == (None, None)
    sync.request(AttributeRequest(corner_normals=True))
    report = sync.update(evaluated())
    (after,) = sync.appearance.meshes.values()
    assert after.corner_normals is not None
    assert after.material_slots is not None
    assert report.attributes_changed
    assert report.count_meshes("kept") == 1
    sync.request(AttributeRequest(material_slots=False), only=True)
    sync.update(evaluated())
    (last,) = sync.appearance.meshes.values()
    assert (last.corner_normals, last.material_slots) == (None, None)


def test_render_visibility_can_be_asked_for(scene: Any) -> None:
    mesh_object("a").hide_render = True
    viewport, render = SceneSync(), SceneSync(for_viewport=False)
    for sync in (viewport, render):
        sync.update(evaluated())
    assert cast_down(viewport).is_hit.all()
    assert not cast_down(render).is_hit.any()


def test_verification_finds_what_was_read_wrongly(scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from perfect_bvh_addon import session

    mesh_object("a")
    sync = SceneSync()
    assert sync.update(evaluated(), verify=True).mismatches == ()

    right = session.read_scene

    def wrong(*arguments: Any, **options: Any) -> Any:
        made = right(*arguments, **options)
        if "reader" not in options:
            made.meshes[0].positions[0] += 1.0
        return made

    monkeypatch.setattr(session, "read_scene", wrong)
    assert sync.update(evaluated(), verify=True).mismatches == ("mesh a: positions differ",)


# Stale scenes --------------------------------------------------------------------------------------------------------


def assert_stale(sync: SceneSync, message: str) -> None:
    with pytest.raises(StaleSceneError, match=message):
        cast_down(sync)
    with pytest.raises(StaleSceneError, match=message):
        sync.scene.test_occlusions([(0, 0, 1)], [DOWN])


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
    assert height(sync) == 0.0  # not evaluated: Blender itself does not know yet
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
        while not done.is_set():
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
    assert wrong
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
    """How far the engine gets before it asks depends on the machine; what comes after must not."""
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
    with pytest.raises(ValueError, match="commit: expected_rays must not be negative, got -1"):
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


# Handlers and sessions -----------------------------------------------------------------------------------------------


def test_handlers_live_as_long_as_somebody_watches(scene: Any) -> None:
    syncs = SceneSync(), SceneSync()
    assert installed() == len(changes._HANDLERS)
    syncs[0].close()
    assert installed() == len(changes._HANDLERS)
    syncs[1].close()
    assert installed() == 0


def test_a_forgotten_sync_is_freed_and_costs_others_no_call(scene: Any) -> None:
    """Blender passes over the next handler of a list if one removes itself from it."""
    sync = SceneSync()
    calls: list[Any] = []
    handlers = bpy.app.handlers.depsgraph_update_post
    handlers.append(other := lambda *arguments: calls.append(arguments))
    gone = weakref.ref(sync)
    del sync
    gc.collect()
    assert gone() is None
    mesh_object("a")
    evaluated()
    handlers.remove(other)
    assert calls
    SceneSync().close()
    assert installed() == 0


def test_handlers_survive_loading_a_file(scene: Any) -> None:
    sync = SceneSync()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert installed() == len(changes._HANDLERS)
    sync.close()


def test_handlers_are_installed_once(scene: Any) -> None:
    syncs = [SceneSync() for _ in range(3)]
    assert [getattr(bpy.app.handlers, name).count(handler) for name, handler in changes._HANDLERS] == [1] * len(
        changes._HANDLERS
    )
    for sync in syncs:
        sync.close()


def test_a_closed_sync_answers_nothing_until_it_is_updated(scene: Any) -> None:
    mesh_object("a", mesh_data("a", *SQUARE))
    sync = SceneSync()
    sync.update(evaluated())
    sync.close()
    assert_stale(sync, "closed")
    sync.update(evaluated())
    assert height(sync) == 0.0


def test_each_scene_layer_and_kind_has_its_own_session(scene: Any) -> None:
    mesh_object("a")
    camera_object()
    clear_sessions()
    viewport = session_of(evaluated())
    assert session_of(evaluated()) is viewport
    render = in_render(session_of)
    assert render is not viewport
    assert in_render(session_of) is render
    assert sessions_of(scene) == (viewport, render)
    other = bpy.data.scenes.new("other")
    other_depsgraph = other.view_layers[0].depsgraph or None
    assert sessions_of(other) == ()
    assert other_depsgraph is None or session_of(other_depsgraph) not in (viewport, render)
    clear_sessions()
    assert sessions_of(scene) == ()


def test_a_session_needs_only_the_difference_for_the_next_render(scene: Any) -> None:
    obj = mesh_object("a")
    camera_object()
    clear_sessions()

    def render(depsgraph: Any) -> Any:
        return session_of(depsgraph).update(depsgraph)

    first = in_render(render)
    obj.location.x = 1.0
    second = in_render(render)
    assert [item.action for item in first.commit.meshes] == ["built"]
    assert second.commit.meshes == ()
    assert (second.moved_count, second.added_count) == (1, 0)


def test_loading_a_file_clears_the_sessions_once_the_add_on_is_registered(scene: Any) -> None:
    mesh_object("a")
    handlers.register()
    try:
        session = session_of(evaluated())
        session.update(evaluated())
        bpy.ops.wm.read_factory_settings(use_empty=True)
        assert_stale(session, "closed")
        assert session_of(evaluated()) is not session
    finally:
        handlers.unregister()
    gc.collect()
    assert installed() == 0
