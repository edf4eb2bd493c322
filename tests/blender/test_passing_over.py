"""Meshes that a sync passes over because Blender did not evaluate them again, and everything that forbids it."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import SQUARE, camera_object, evaluated, in_render, mesh_data, mesh_object
from perfect_bvh_addon import AttributeRequest, SceneSync
from perfect_bvh_addon.events import changes
from perfect_bvh_addon.events.evaluation_log import EvaluationLog
from perfect_bvh_addon.live import sync_cache
from perfect_bvh_addon.live.sync_cache import clear_syncs, sync_of, syncs_of
from perfect_bvh_addon.sync.report import SyncReport
from perfect_bvh_addon.sync.state import SceneState
from process_memory import resident_megabytes

PASSED_OVER = "Blender did not evaluate it again"


def reasons(report: SyncReport) -> dict[str, str]:
    return {mesh.name: mesh.reason for mesh in report.meshes}


def thing(name: str) -> Any:
    return bpy.data.objects[name]


def deform(name: str, factor: float = 2.0, *, data: Any = None) -> None:
    data = data or thing(name).data
    points = np.empty(len(data.vertices) * 3, np.float32)
    data.vertices.foreach_get("co", points)
    data.vertices.foreach_set("co", points * np.float32(factor))
    data.update()


@pytest.fixture
def sync(scene: Any) -> Iterator[SceneSync]:
    """Synced: a plain mesh, one under a modifier, and one beside them."""
    mesh_object("plain", mesh_data("plain", *SQUARE))
    mesh_object("smooth", mesh_data("smooth")).modifiers.new("subsurf", "SUBSURF")
    mesh_object("other", mesh_data("other"))
    made = SceneSync()
    made.update(evaluated())
    yield made
    made.close()


def test_what_was_not_evaluated_is_not_read(sync: SceneSync, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []
    from perfect_bvh_addon.extract.geometry import mesh_table

    original = mesh_table.read_mesh

    def spy(mesh: Any, key: Any, name: str, *rest: Any) -> Any:
        read.append(name)
        return original(mesh, key, name, *rest)

    monkeypatch.setattr(mesh_table, "read_mesh", spy)
    thing("other").location.x = 2.0
    report = sync.update(evaluated())
    assert (read, report.moved_count) == ([], 1)
    deform("other")
    report = sync.update(evaluated(), verify=True)
    assert read[0] == "other"
    assert report.mismatches == ()
    assert [mesh.reason for mesh in report.meshes].count(PASSED_OVER) == 2
    assert report.count_meshes("deformed") == 1


def move_a_vertex_by_operator() -> None:
    bpy.context.view_layer.objects.active = thing("plain")
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0, 0, 1))
    bpy.ops.object.mode_set(mode="OBJECT")


def undo() -> None:
    bpy.ops.ed.undo_push(message="one")
    deform("plain")
    bpy.ops.ed.undo_push(message="two")
    bpy.ops.ed.undo()


def lose_the_handlers() -> None:
    bpy.app.handlers.depsgraph_update_post.clear()
    deform("plain")
    evaluated()


REASONS_TO_READ: dict[str, Callable[[], None]] = {
    "deformed": lambda: deform("plain"),
    "edited in edit mode": move_a_vertex_by_operator,
    "undone": undo,
    "handlers were lost": lose_the_handlers,
    "other data": lambda: setattr(thing("plain"), "data", mesh_data("new")),
    "modifier added": lambda: thing("plain").modifiers.new("m", "SOLIDIFY") and None,
    "file loaded": lambda: bpy.ops.wm.read_factory_settings(use_empty=True) and mesh_object("plain") and None,
}


@pytest.mark.parametrize("name", REASONS_TO_READ)
def test_a_reason_to_read(sync: SceneSync, name: str) -> None:
    REASONS_TO_READ[name]()
    report = sync.update(evaluated(), verify=True)
    assert report.mismatches == ()
    assert PASSED_OVER not in {reasons(report).get(mesh) for mesh in ("plain", "new")}


def test_each_uncertainty_alone_is_a_reason_to_read(sync: SceneSync) -> None:
    """Mostly several come together."""
    plain = thing("plain").data
    token, uids = ("mesh", plain.session_uid, 0), (thing("plain").session_uid, plain.session_uid)
    mesh, other = (thing(name).evaluated_get(evaluated()).data for name in ("plain", "smooth"))
    cache, log = sync._cache.meshes, changes._log
    reading = replace(cache, meshes={})
    assert cache.find_untouched(token, mesh, uids, reading, log) is cache.meshes[token]
    ignorant = EvaluationLog()
    while ignorant.now <= cache.since:
        ignorant.forget()
    for uncertain in (
        cache.find_untouched(("mesh", plain.session_uid, 1), mesh, uids, reading, log),
        cache.find_untouched(token, other, uids, reading, log),
        cache.find_untouched(token, mesh, uids, replace(reading, graph=cache.graph + 1), log),
        cache.find_untouched(token, mesh, uids, replace(reading, attributes=AttributeRequest(corner_uvs=True)), log),
        cache.find_untouched(token, mesh, uids, reading, None),
        cache.find_untouched(token, mesh, uids, reading, ignorant),
        replace(cache, since=-1).find_untouched(token, mesh, uids, reading, log),
    ):
        assert uncertain is None


def test_after_undo_and_redo_everything_is_read(sync: SceneSync) -> None:
    bpy.ops.ed.undo_push(message="one")
    thing("other").location.x = 1.0
    bpy.ops.ed.undo_push(message="two")
    for step in (bpy.ops.ed.undo, bpy.ops.ed.redo):
        sync.update(evaluated())
        step()
        assert PASSED_OVER not in reasons(sync.update(evaluated(), verify=True)).values()
        assert set(reasons(sync.update(evaluated())).values()) == {PASSED_OVER}


def test_what_is_edited_is_read_every_time(sync: SceneSync) -> None:
    """Some modes change a mesh and report nothing until they end."""
    bpy.context.view_layer.objects.active = thing("smooth")
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        for _ in range(2):
            found = reasons(sync.update(evaluated(), verify=True))
            assert found["smooth"] != PASSED_OVER
        assert found["plain"] == PASSED_OVER
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")


def test_an_update_within_a_handler_that_comes_first(sync: SceneSync) -> None:
    """The log has not been told yet what was evaluated."""
    heights: list[float] = []

    def early(_: Any, depsgraph: Any) -> None:
        sync.update(depsgraph)
        hits = sync.scene.cast_rays([(0.2, 0.2, 10)], [(0, 0, -1)])
        heights.append(10.0 - float(hits.t_hit[0]))

    bpy.app.handlers.depsgraph_update_post.insert(0, early)
    try:
        for data_height in (1.0, 2.0):
            for vertex in thing("plain").data.vertices:
                vertex.co.z = data_height
            thing("plain").data.update()
            thing("other").hide_viewport = thing("smooth").hide_viewport = True
            evaluated()
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(early)
    assert heights[0] == 1.0
    assert heights[-1] == 2.0


def test_without_handlers_everything_is_read(scene: Any) -> None:
    mesh_object("plain")
    sync = SceneSync(watch=False)
    gc.collect()  # no forgotten listener of another test
    sync.update(evaluated())
    assert PASSED_OVER not in reasons(sync.update(evaluated())).values()


def test_more_attributes_must_be_read(sync: SceneSync) -> None:
    sync.request(AttributeRequest(corner_uvs=True, corner_normals=True))
    assert PASSED_OVER not in reasons(sync.update(evaluated())).values()
    assert set(reasons(sync.update(evaluated())).values()) == {PASSED_OVER}


def test_an_update_that_failed_after_reading_hides_nothing(sync: SceneSync, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was read then is known to the reader, and not to the engine."""
    deform("plain")
    with monkeypatch.context() as patch:
        patch.setattr(SceneState, "compare", interrupted)
        with pytest.raises(KeyboardInterrupt):
            sync.update(evaluated())
    report = sync.update(evaluated())
    assert report.count_meshes("deformed") == 1
    assert sync.scene.cast_rays([(1.5, 1.5, 5)], [(0, 0, -1)]).is_hit.all()


def interrupted(*_: Any) -> Any:
    raise KeyboardInterrupt


def test_verification_finds_what_blender_was_not_told(sync: SceneSync) -> None:
    """A script that writes into evaluated data is the one thing that passing over misses."""
    data = thing("smooth").evaluated_get(evaluated()).data
    sync.update(evaluated())
    points = np.zeros(len(data.vertices) * 3, np.float32)
    data.vertices.foreach_set("co", points)
    report = sync.update(bpy.context.evaluated_depsgraph_get(), verify=True)
    (mismatch,) = report.mismatches
    assert mismatch.endswith("positions differ")


# Scenes, renders, memory ---------------------------------------------------------------------------------------------


@pytest.fixture
def registered(scene: Any) -> Iterator[None]:
    clear_syncs()
    sync_cache.register()
    yield
    sync_cache.unregister()


def test_cached_syncs_go_with_their_scenes_and_layers(scene: Any, registered: None) -> None:
    mesh_object("a")
    other = bpy.data.scenes.new("other")
    layer = other.view_layers.new("second")
    bpy.context.window.scene = other
    for view_layer in (layer, other.view_layers[0]):
        bpy.context.window.view_layer = view_layer
        sync_of(evaluated()).update(evaluated())
    assert len(syncs_of(other)) == 2
    other.view_layers.remove(layer)
    evaluated()
    assert len(syncs_of(other)) == 1
    uid = other.session_uid
    bpy.context.window.scene = scene
    kept = sync_of(evaluated())
    bpy.data.scenes.remove(other)
    mesh_object("b")
    evaluated()
    assert uid not in {key[0] for key in sync_cache._syncs}
    assert syncs_of(scene) == (kept,)


def test_cached_syncs_used_longest_ago_go_beyond_the_limit(
    scene: Any, registered: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=40, y_subdivisions=40)
    other = scene.view_layers.new("other")
    third = scene.view_layers.new("third")
    first = scene.view_layers[0]

    def update(layer: Any) -> SceneSync:
        bpy.context.window.view_layer = layer
        sync_of(evaluated()).update(evaluated())
        return sync_of(evaluated())

    def cast(sync: SceneSync) -> bool:
        return bool(sync.scene.cast_rays([(0.01, 0.02, 5)], [(0, 0, -1)]).is_hit[0])

    def limit_cache(byte_count: int | None) -> None:
        monkeypatch.setattr(sync_cache, "cache_byte_limit", lambda: byte_count)

    one, two = update(first), update(other)
    assert one.byte_count == two.byte_count > 40 * 40 * 2 * 12
    limit_cache(2 * one.byte_count)
    assert update(first) is one
    three = update(third)  # `two` was used longest ago
    assert syncs_of(scene) == (one, three)
    assert cast(two), "what holds it may go on"
    limit_cache(1)
    assert update(first) is one
    assert syncs_of(scene) == (one,)
    assert cast(one)
    limit_cache(None)
    again = update(other)
    assert again is not two
    assert cast(again)
    assert syncs_of(scene) == (one, again)


def test_linked_objects_and_overrides(scene: Any, registered: None, tmp_path: Path) -> None:
    """Another file's objects, reloaded from a changed file as well."""
    path = str(tmp_path / "library.blend")
    mesh_object("linked", mesh_data("linked", *SQUARE))
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["linked"]
    linked = bpy.data.objects["linked"]
    bpy.context.scene.collection.objects.link(linked)
    sync = SceneSync()
    assert sync.update(evaluated(), verify=True).added_count == 1
    override = linked.override_create(remap_local_usages=True)
    override.location.z = 2.0
    report = sync.update(evaluated(), verify=True)
    assert report.mismatches == ()
    assert sync.scene.cast_rays([(0, 0, 10)], [(0, 0, -1)]).t_hit[0] == 8.0
    bpy.data.libraries[0].reload()
    report = sync.update(evaluated(), verify=True)
    assert (report.mismatches, len(sync.record.instances)) == ((), 1)
    sync.close()


def test_two_depsgraphs_at_once(scene: Any, registered: None) -> None:
    """What a render has seen says nothing about the viewport, and the other way round."""
    mesh_object("a", mesh_data("a", *SQUARE)).modifiers.new("m", "SOLIDIFY").show_render = False
    sync = SceneSync()
    for factor in (1.0, 2.0, 0.5):
        deform("a", factor)
        assert in_render(lambda depsgraph: sync.update(depsgraph, verify=True)).mismatches == ()
        assert sync.update(evaluated(), verify=True).mismatches == ()
        assert sync.update(evaluated(), verify=True).mismatches == ()
    sync.close()


class _AnimationEngine(bpy.types.RenderEngine):
    bl_idname = "PERFECT_BVH_TEST_ANIMATION"
    bl_label = "Animation"
    reports: list[SyncReport] = []  # noqa: RUF012

    def render(self, depsgraph: Any) -> None:
        result = self.begin_result(0, 0, self.resolution_x, self.resolution_y)
        try:
            type(self).reports.append(sync_of(depsgraph).update(depsgraph, verify=True))
        finally:
            self.end_result(result)


@pytest.mark.parametrize("persistent", [True, False])
def test_an_animation_syncs_what_changes(scene: Any, registered: None, tmp_path: Path, persistent: bool) -> None:
    mesh_object("still")
    moving = mesh_object("moving", location=(3, 0, 0))
    for frame, x in ((1, 3.0), (4, 6.0)):
        moving.location.x = x
        moving.keyframe_insert("location", frame=frame)
    camera_object()
    scene.frame_start, scene.frame_end = 1, 4
    scene.render.use_persistent_data = persistent
    scene.render.filepath = str(tmp_path / "frame")
    bpy.utils.register_class(_AnimationEngine)
    _AnimationEngine.reports = []
    scene.render.engine = _AnimationEngine.bl_idname
    try:
        bpy.ops.render.render(animation=True)
    finally:
        bpy.utils.unregister_class(_AnimationEngine)
    first, *others = _AnimationEngine.reports
    assert len(others) == 3
    assert first.commit.count("built") == 2
    for report in others:
        assert report.mismatches == ()
        assert (report.moved_count, report.added_count, report.commit.meshes) == (1, 0, ())
        assert (set(reasons(report).values()) == {PASSED_OVER}) == persistent


def test_memory_is_flat_over_a_thousand_edits(sync: SceneSync) -> None:
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=100, y_subdivisions=100)
    bpy.context.object.name = "grid"
    used = []
    for step in range(1000):
        if step % 4 == 0:
            thing("other").location.x = step % 7
        elif step % 4 == 1:
            deform("grid", 1.0 + 0.01 * (step % 3 - 1))
        elif step % 4 == 2:
            mesh_object("extra", mesh_data("extra"))
        else:
            bpy.data.meshes.remove(bpy.data.meshes["extra"])
        sync.update(evaluated())
        if step % 100 == 99:
            gc.collect()
            used.append(resident_megabytes())
    # A grid's copy is 1 MB: one kept at each edit would be a gigabyte.
    assert used[-1] - used[2] < 20.0
