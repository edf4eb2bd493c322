"""Meshes that a sync skips because Blender did not evaluate them again, and everything that prevents skipping."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import SQUARE, evaluated, mesh_data, mesh_object
from blender.syncing import PASSED_OVER, deform, reasons
from perfect_bvh_addon import AttributeRequest, SceneSync
from perfect_bvh_addon.events import changes
from perfect_bvh_addon.events.asking import EvaluationLog
from perfect_bvh_addon.sync.state import SceneState
from process_memory import held_megabytes


def thing(name: str) -> Any:
    return bpy.data.objects[name]


@pytest.fixture
def sync(scene: Any) -> Iterator[SceneSync]:
    """A synced scene: a plain mesh, one under a modifier, and a third one."""
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
    """In most cases several reasons occur together."""
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
    """The handler runs before the evaluation is logged."""
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
    """The failed update's readings are known to the reader but not to the engine."""
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
    """Skipping misses only scripts that write into evaluated data."""
    data = thing("smooth").evaluated_get(evaluated()).data
    sync.update(evaluated())
    points = np.zeros(len(data.vertices) * 3, np.float32)
    data.vertices.foreach_set("co", points)
    report = sync.update(bpy.context.evaluated_depsgraph_get(), verify=True)
    (mismatch,) = report.mismatches
    assert mismatch.endswith("positions differ")


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
            used.append(held_megabytes())
    # A grid's copy is 1 MB: one kept at each edit would be a gigabyte.
    assert used[-1] - used[2] < 20.0
