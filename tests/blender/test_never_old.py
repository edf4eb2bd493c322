"""A sync that watches Blender refuses every query after an edit, whether Blender has evaluated it or not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy
import mathutils
import numpy as np
import perfect_bvh
import pytest
from blender.builders import SQUARE, camera_object, collection, mesh_data, mesh_object
from blender.syncing import DOWN
from perfect_bvh import Camera, StaleSceneError
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.events import changes

X, Y = np.meshgrid(np.linspace(-1.0, 9.0, 41), np.linspace(-1.0, 3.0, 17))
ORIGINS = np.stack([X, Y, np.full_like(X, 20.0)], axis=-1)


@pytest.fixture
def village(scene: Any) -> Iterator[SceneSync]:
    """Squares "a" (with a shape key), "b" in the collection "c", an armature, and a sync of all that."""
    keyed = mesh_object("a", mesh_data("a", *SQUARE))
    keyed.shape_key_add(name="Basis")
    raised = keyed.shape_key_add(name="raised")
    raised.value = 0.0  # newer versions begin with 1
    for point in raised.data:
        point.co.z += 1.0
    mesh_object("b", mesh_data("b", *SQUARE), collection=collection("c"), location=(3, 0, 0))
    bpy.ops.object.armature_add(location=(0, 0, -5))
    animated = mesh_object("animated", mesh_data("d", *SQUARE), location=(6, 0, 0))
    for frame, z in ((1, 0.0), (11, 5.0)):
        animated.location.z = z
        animated.keyframe_insert("location", frame=frame)
    scene.view_layers.new("second").layer_collection.children["c"].exclude = True
    bpy.data.scenes.new("other").collection.objects.link(bpy.data.objects["b"])
    camera_object().location = (3, 1, 20)
    scene.frame_set(1)
    made = SceneSync()
    made.update(bpy.context.evaluated_depsgraph_get())
    assert made.scene.is_current
    yield made
    made.close()


def objects() -> Any:
    return bpy.data.objects


def set_vertices(mesh: Any, z: float) -> None:
    points = np.array(SQUARE[0], np.float32)
    points[:, 2] = z
    mesh.vertices.foreach_set("co", points.ravel())


def instance_collection() -> None:
    empty = bpy.data.objects.new("instancer", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", bpy.data.collections["c"]
    empty.location.y = 1.5
    bpy.context.scene.collection.objects.link(empty)


def drive() -> None:
    objects()["a"].driver_add("location", 2).driver.expression = "5.0"


def add_array() -> None:
    objects()["a"].modifiers.new("more", "ARRAY").count = 3


def limit_location() -> None:
    constraint = objects()["a"].constraints.new("LIMIT_LOCATION")
    constraint.use_min_z, constraint.min_z = True, 2.0


def replace_geometry() -> None:
    mesh = objects()["b"].data
    mesh.clear_geometry()
    mesh.from_pydata([(0, 0, 1), (1, 0, 1), (0, 1, 1)], [], [(0, 1, 2)])


def empty_handlers() -> None:
    for name, _ in changes._HANDLERS:
        getattr(bpy.app.handlers, name).clear()


def show_layer(name: str) -> None:
    bpy.context.window.view_layer = bpy.context.scene.view_layers[name]


def layer_collection() -> Any:
    return bpy.context.view_layer.layer_collection.children["c"]


EDITS: dict[str, Callable[[], object]] = {
    "location": lambda: setattr(objects()["a"], "location", (0, 0, 2)),
    "one coordinate": lambda: setattr(objects()["a"].location, "z", 2.0),
    "matrix": lambda: setattr(objects()["a"], "matrix_world", mathutils.Matrix.Translation((0, 0, 2))),
    "parent": lambda: setattr(objects()["a"], "parent", objects()["b"]),
    "object removed": lambda: objects().remove(objects()["a"]),
    "objects removed": lambda: bpy.data.batch_remove([objects()["a"], objects()["b"]]),
    "mesh removed": lambda: bpy.data.meshes.remove(objects()["b"].data),
    "object linked": lambda: bpy.context.scene.collection.objects.link(
        bpy.data.objects.new("n", mesh_data("n", *SQUARE))
    ),
    "object unlinked": lambda: bpy.data.collections["c"].objects.unlink(objects()["b"]),
    "collection unlinked": lambda: bpy.context.scene.collection.children.unlink(bpy.data.collections["c"]),
    "collection excluded": lambda: setattr(layer_collection(), "exclude", True),
    "collection hidden in the layer": lambda: setattr(layer_collection(), "hide_viewport", True),
    "collection hidden": lambda: setattr(bpy.data.collections["c"], "hide_viewport", True),
    "collection instanced": instance_collection,
    "hide_viewport": lambda: setattr(objects()["a"], "hide_viewport", True),
    "hide_render": lambda: setattr(objects()["a"], "hide_render", True),
    "hide_set": lambda: objects()["a"].hide_set(True),
    "vertex": lambda: setattr(objects()["b"].data.vertices[0].co, "z", 3.0),
    "vertices": lambda: set_vertices(objects()["b"].data, 3.0),
    "mesh transformed": lambda: objects()["b"].data.transform(mathutils.Matrix.Translation((0, 0, 2))),
    "geometry replaced": replace_geometry,
    "another mesh": lambda: setattr(objects()["a"], "data", objects()["b"].data),
    "shape key": lambda: setattr(objects()["a"].data.shape_keys.key_blocks["raised"], "value", 1.0),
    "modifier": add_array,
    "constraint": limit_location,
    "driver": drive,
    "pose": lambda: setattr(objects()["Armature"].pose.bones[0], "location", (0, 0, 1)),
    "material": lambda: objects()["b"].data.materials.append(bpy.data.materials.new("red")),
    "frame": lambda: bpy.context.scene.frame_set(11),
    "frame_current": lambda: setattr(bpy.context.scene, "frame_current", 11),
    "frame_subframe": lambda: setattr(bpy.context.scene, "frame_subframe", 0.5),
    "view layer": lambda: show_layer("second"),
    "scene": lambda: setattr(bpy.context.window, "scene", bpy.data.scenes["other"]),
    "handlers emptied": empty_handlers,
    "handlers emptied, then an edit": lambda: (empty_handlers(), setattr(objects()["a"].location, "z", 2.0)),
}
UNTAGGED_IN_4_2 = {"vertices"}


@pytest.mark.parametrize("is_evaluated", [False, True], ids=["pending", "evaluated"])
@pytest.mark.parametrize("edit", EDITS)
def test_after_any_edit_it_raises_until_it_is_updated(village: SceneSync, edit: str, is_evaluated: bool) -> None:
    if edit in UNTAGGED_IN_4_2 and bpy.app.version < (5, 0):
        pytest.skip("Blender before 5.0 does not notice that vertices are moved by scripts")
    EDITS[edit]()
    if is_evaluated:
        bpy.context.view_layer.update()
    assert_refuses(village)
    assert_answers_as_a_fresh_one(village)


def test_undo_redo_and_another_file_make_it_raise(village: SceneSync, tmp_path: Path) -> None:
    path = str(tmp_path / "village.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.ed.undo_push(message="before")
    objects()["a"].location.z = 1.0
    bpy.ops.ed.undo_push(message="moved")
    for step in (
        bpy.ops.ed.undo,
        bpy.ops.ed.redo,
        lambda: bpy.ops.wm.open_mainfile(filepath=path),
        lambda: bpy.ops.wm.read_factory_settings(use_empty=True),
    ):
        assert_answers_as_a_fresh_one(village)
        step()
        assert_refuses(village)
    assert_answers_as_a_fresh_one(village)


def test_edits_one_after_the_other_without_any_evaluation(village: SceneSync) -> None:
    for step in range(1, 6):
        objects()["a"].location.z = step
        assert_refuses(village)
        assert_answers_as_a_fresh_one(village)
        assert village.scene.cast_rays([(0.2, 0.2, 10.0)], [DOWN]).t_hit[0] == 10.0 - step


def test_a_depsgraph_that_waits_for_an_evaluation_is_evaluated_by_the_update(village: SceneSync) -> None:
    depsgraph = bpy.context.evaluated_depsgraph_get()
    objects()["a"].location.z = 2.0
    village.update(depsgraph)
    assert_answers_as_a_fresh_one(village, update=False)


def test_a_layer_that_is_not_active_is_watched_as_well(village: SceneSync) -> None:
    other = bpy.data.scenes["other"]
    with bpy.context.temp_override(scene=other, view_layer=other.view_layers[0]):
        village.update(bpy.context.evaluated_depsgraph_get())
    assert village.scene.is_current
    objects()["b"].location.z = 4.0
    assert_refuses(village)
    with bpy.context.temp_override(scene=other, view_layer=other.view_layers[0]):
        village.update(bpy.context.evaluated_depsgraph_get())
    assert village.scene.cast_rays([(3.2, 0.2, 10.0)], [DOWN]).t_hit[0] == 6.0
    bpy.data.scenes.remove(other)
    assert_refuses(village)


def test_a_scene_is_watched_for_as_long_as_it_lives(village: SceneSync) -> None:
    own = SceneSync()
    own.update(bpy.context.evaluated_depsgraph_get())
    scene = own.scene
    del own
    assert scene.is_current
    objects()["a"].location.z = 2.0
    assert not scene.is_current


def test_the_scene_of_a_closed_sync_refuses_and_an_updated_one_is_watched_again(village: SceneSync) -> None:
    scene = village.scene
    village.close()
    with pytest.raises(StaleSceneError, match="the sync was closed"):
        scene.cast_rays(ORIGINS, DOWN)
    assert_answers_as_a_fresh_one(village)
    objects()["a"].location.z = 2.0
    assert_refuses(village)


EVALUATION_HANDLERS = ("depsgraph_update_pre", "depsgraph_update_post", "frame_change_pre", "frame_change_post")
QUERIES: dict[str, Callable[[SceneSync], object]] = {
    "cast_rays": lambda sync: sync.scene.cast_rays(ORIGINS, DOWN),
    "test_occlusions": lambda sync: sync.scene.test_occlusions(ORIGINS, DOWN),
    "count_intersections": lambda sync: sync.scene.count_intersections(ORIGINS, DOWN),
    "list_intersections": lambda sync: sync.scene.list_intersections(ORIGINS, DOWN),
    "compute_closest_points": lambda sync: sync.scene.compute_closest_points(ORIGINS),
    "walk_ray": lambda sync: sync.scene.walk_ray(ORIGINS[0, 0], DOWN),
    "statistics": lambda sync: sync.scene.statistics(),
    "snapshot": lambda sync: sync.scene.snapshot(),
    "render": lambda sync: perfect_bvh.render(sync.scene, camera(sync), mode="normal", size=(8, 4), samples=1),
}


def camera(sync: SceneSync) -> Camera:
    found = sync.camera
    assert found is not None
    return found


@pytest.mark.parametrize("query", QUERIES)
def test_each_query_looks_for_pending_changes(village: SceneSync, query: str) -> None:
    ask = QUERIES[query]
    ask(village)
    objects()["a"].location.z = 2.0
    with pytest.raises(StaleSceneError, match=r"evaluated again since the last update: call update\(\)"):
        ask(village)
    village.update(bpy.context.evaluated_depsgraph_get())
    ask(village)
    objects()["a"].location.z = 3.0
    assert not village.scene.is_current


def test_with_nothing_pending_nothing_is_evaluated_and_no_handler_called(village: SceneSync) -> None:
    calls: list[str] = []
    bpy.app.driver_namespace["count_evaluations"] = lambda: calls.append("driver") or 0.0
    objects()["a"].driver_add("location", 0).driver.expression = "count_evaluations()"
    village.update(bpy.context.evaluated_depsgraph_get())
    assert calls, "or else the driver counts nothing"
    calls.clear()
    counters = {name: (lambda *_, name=name: calls.append(name)) for name in EVALUATION_HANDLERS}
    for name, counter in counters.items():
        getattr(bpy.app.handlers, name).append(counter)
    for ask in QUERIES.values():
        ask(village)
    assert village.scene.is_current
    assert calls == []
    objects()["a"].location.y = 1.0
    assert not village.scene.is_current
    assert calls == ["depsgraph_update_pre", "driver", "depsgraph_update_post"], "evaluated once"
    for name, counter in counters.items():
        getattr(bpy.app.handlers, name).remove(counter)


def assert_refuses(sync: SceneSync) -> None:
    with pytest.raises(StaleSceneError, match=r"call update\(\)"):
        sync.scene.cast_rays(ORIGINS, DOWN)
    for ask in (query for name, query in QUERIES.items() if name != "render"):
        with pytest.raises(StaleSceneError, match=r"call update\(\)"):
            ask(sync)
    assert not sync.scene.is_current


def assert_answers_as_a_fresh_one(sync: SceneSync, update: bool = True) -> None:
    """update: update the sync first, from the active depsgraph."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    if update:
        assert sync.update(depsgraph, verify=True).mismatches == ()
    fresh = SceneSync()
    fresh.update(depsgraph)
    hits, expected = (one.scene.cast_rays(ORIGINS, DOWN) for one in (sync, fresh))
    np.testing.assert_array_equal(hits.t_hit, expected.t_hit)
    np.testing.assert_array_equal(sync.describe(hits.instance_ids).names, fresh.describe(expected.instance_ids).names)
    fresh.close()
