"""Blender's handlers and the add-on's own syncs: their lifetimes, through file loads and reloads."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import bpy
import perfect_bvh
import pytest
from blender.builders import (
    SQUARE,
    evaluated,
    mesh_data,
    mesh_object,
)
from blender.syncing import assert_stale, height, installed
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.events import asking, changes
from perfect_bvh_addon.events import changes as edits
from perfect_bvh_addon.live import scene_sync, sync_cache
from perfect_bvh_addon.live.scene_view import SceneView
from perfect_bvh_addon.live.sync_cache import sync_of


def test_handlers_live_as_long_as_somebody_watches(scene: Any) -> None:
    syncs = SceneSync(), SceneSync()
    assert installed() == len(changes._HANDLERS)
    syncs[0].close()
    assert installed() == len(changes._HANDLERS)
    syncs[1].close()
    assert installed() == 0


def test_a_forgotten_sync_is_freed_and_costs_others_no_call(scene: Any) -> None:
    """Blender skips the next handler of a list if a handler removes itself from the list."""
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


TELLING = (  # all except those that only report where Blender must not be asked
    *changes._FIRST[:-1],
    ("depsgraph_update_post", changes._on_depsgraph_update),
    ("frame_change_post", changes._on_frame_change),
    ("undo_post", changes._on_undo),
    ("redo_post", changes._on_redo),
    ("load_post", changes._on_load),
)


@pytest.mark.parametrize(
    ("event", "message"),
    [
        ("depsgraph_update_pre", "evaluated again"),
        ("depsgraph_update_post", "evaluated again"),
        ("frame_change_pre", "the frame was changed"),
        ("frame_change_post", "the frame was changed"),
        ("undo_pre", "a step was undone"),
        ("redo_pre", "a step was redone"),
        ("undo_post", "a step was undone"),
        ("redo_post", "a step was redone"),
        ("load_pre", "another file was loaded"),
        ("load_post", "another file was loaded"),
    ],
)
def test_each_event_alone_makes_it_stale(scene: Any, event: str, message: str) -> None:
    """In most cases several events occur together."""
    mesh_object("a", mesh_data("a", *SQUARE))
    sync = SceneSync()
    sync.update(evaluated())
    assert height(sync) == 0.0
    handler = dict(TELLING)[event]
    assert (event, handler) in changes._HANDLERS and handler in getattr(bpy.app.handlers, event)
    handler(scene, bpy.context.evaluated_depsgraph_get())
    assert_stale(sync, message)
    asking.forget_all()  # as the last handler would
    assert sync.update(evaluated(), verify=True).mismatches == ()
    sync.close()


@pytest.mark.parametrize("event", [name for name, _ in TELLING])
def test_what_came_before_an_undo_or_a_file_is_not_known(scene: Any, event: str) -> None:
    sync = SceneSync()
    sync.update(evaluated())
    since = changes._log.now
    dict(TELLING)[event](scene, bpy.context.evaluated_depsgraph_get())
    asking.forget_all()
    is_known = changes._log.is_untouched(0, (), since)
    assert is_known == event.startswith(("depsgraph_update", "frame_change"))
    sync.close()


def test_handlers_that_somebody_removed_are_missed_by_the_next_who_reads(scene: Any, registered: None) -> None:
    """Scripts empty Blender's lists. Edits since then are unknown, so all images and answers count as old."""
    obj = mesh_object("a", mesh_data("a", *SQUARE))
    sync = SceneSync()
    sync.update(evaluated())
    count = changes.edit_count(scene.session_uid)
    for name, _ in changes._HANDLERS:
        getattr(bpy.app.handlers, name).clear()
    obj.location.z = 2.0
    evaluated()
    snapshot = sync._state.scene._scene.snapshot()
    assert snapshot.generation == 1, "it could not have been told"
    sync_of(evaluated()).update(evaluated())
    assert installed() == len(changes._HANDLERS)
    assert_stale(sync, "Blender's handlers were removed since the last update")
    assert changes.edit_count(scene.session_uid) > count
    sync.update(evaluated())
    assert height(sync) == 2.0

    bpy.app.handlers.depsgraph_update_post.clear()
    other = SceneSync()
    assert_stale(sync, "Blender's handlers were removed since the last update")
    for one in (sync, other):
        one.close()


@pytest.mark.parametrize("goes_on", [False, True])
def test_a_frame_that_a_job_sets_is_no_edit(scene: Any, goes_on: bool) -> None:
    """Viewports evaluate what is animated afterwards; edits before and after that count."""
    sync = SceneSync()
    obj = mesh_object("a", mesh_data("a", *SQUARE))
    for frame in (1, 9):
        obj.location.x = frame
        obj.keyframe_insert("location", index=0, frame=frame)
    sync.update(evaluated())
    uid = scene.session_uid

    def edits_of(change: Any) -> int:
        before = changes.edit_count(uid)
        change()
        bpy.context.view_layer.update()
        return changes.edit_count(uid) - before

    view = SceneView("test", scene, bpy.context.view_layer)

    def visit(frame: int) -> None:
        view.read(lambda moment: moment.go_to(frame, 0.0) if goes_on else None, 8 if goes_on else frame)

    assert edits_of(lambda: setattr(obj.location, "z", 1.0)) == 1
    for frame in (2, 3):
        assert edits_of(lambda frame=frame: visit(frame)) == 0
        assert edits_of(lambda frame=frame: setattr(obj.location, "z", float(frame))) == 1
    scene.frame_set(1)
    assert edits_of(lambda: setattr(obj.location, "z", 9.0)) == 1
    sync.close()


def test_what_is_shown_anew_was_not_edited(scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """As Blender reports it when a maximized editor or a window closes."""
    obj = mesh_object("a", mesh_data("a", *SQUARE))
    shading = {"is_updated_transform": False, "is_updated_geometry": False, "is_updated_shading": True}
    of_object = SimpleNamespace(id=obj, **shading)
    of_scene = SimpleNamespace(id=scene, **shading)
    of_mesh = SimpleNamespace(id=obj.data, **shading)
    moved = SimpleNamespace(id=obj, **shading | {"is_updated_transform": True})

    def is_edit(screens: set[int], *updates: Any) -> bool:
        monkeypatch.setattr(edits, "shown_screens", lambda: frozenset(screens))
        return edits.is_edit(SimpleNamespace(updates=updates))

    assert not is_edit({1, 2}, of_scene)
    assert is_edit({1, 2}, of_scene, of_object), "all screens are still there"
    assert is_edit({1, 2, 3}, of_scene, of_object), "one more"
    assert not is_edit({1, 2}, of_scene, of_object)
    assert is_edit({1, 2}, of_scene, of_object), "it is reported once"
    for updates in ((of_object,), (of_scene, of_object, moved), (of_scene, of_object, of_mesh)):
        assert not is_edit({1, 2})
        assert is_edit({1}, *updates)
    assert not is_edit({1})


def test_handlers_only_mark_stale(scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """After any event, nothing is read, compared or built before a query asks for it."""
    obj = mesh_object("a", mesh_data("a", *SQUARE))
    obj.keyframe_insert("location", frame=1)
    bpy.ops.ed.undo_push(message="before")
    sync_cache.register()
    sync, own = SceneSync(), sync_of(evaluated())
    try:
        for one in (sync, own):
            one.update(evaluated())
        work: list[str] = []
        monkeypatch.setattr(scene_sync, "read_scene", lambda *_, **__: work.append("read"))
        for method in ("update_mesh", "set_transforms", "add_mesh", "add_instances", "commit"):
            monkeypatch.setattr(perfect_bvh.Scene, method, lambda *_, _name=method, **__: work.append(_name))
        obj.data.vertices[0].co.z = 1.0
        obj.data.update()
        changes_of_all_kinds: tuple[Callable[[], object], ...] = (
            evaluated,
            lambda: scene.frame_set(7),
            lambda: bpy.ops.ed.undo_push(message="deformed"),
            bpy.ops.ed.undo,
            bpy.ops.ed.redo,
            lambda: bpy.ops.wm.read_factory_settings(use_empty=True),
        )
        for change in changes_of_all_kinds:
            change()
            assert work == []
            assert_stale(sync, r"call update\(\)")
    finally:
        sync.close()
        sync_cache.unregister()


def test_a_closed_sync_answers_nothing_until_it_is_updated(scene: Any) -> None:
    mesh_object("a", mesh_data("a", *SQUARE))
    sync = SceneSync()
    sync.update(evaluated())
    sync.close()
    assert_stale(sync, "closed")
    sync.update(evaluated())
    assert height(sync) == 0.0


def test_a_sync_outlives_a_reload_of_the_add_on(scene: Any) -> None:
    """It is still kept current; only the add-on's own syncs are dropped, and made again on request."""
    import perfect_bvh_addon

    obj = mesh_object("a", mesh_data("a", *SQUARE))
    perfect_bvh_addon.register()
    sync = SceneSync()
    try:
        for z in (1.0, 2.0, 3.0):
            cached = sync_of(evaluated())
            cached.update(evaluated())
            sync.update(evaluated())
            perfect_bvh_addon.unregister()
            assert_stale(cached, "closed")
            assert height(sync) == obj.location.z
            perfect_bvh_addon.register()
            obj.location.z = z
            depsgraph = evaluated()
            assert_stale(sync, r"call update\(\)")
            sync.update(depsgraph, verify=True)
            assert height(sync) == z
            assert sync_of(depsgraph) is not cached
    finally:
        sync.close()
        perfect_bvh_addon.unregister()
