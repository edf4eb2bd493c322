"""The syncs that the add-on keeps: one for each scene, view layer and kind of depsgraph, and when each of them ends."""

from __future__ import annotations

import gc
from typing import Any

import bpy
import pytest
from blender.builders import camera_object, evaluated, in_render, mesh_object
from blender.syncing import assert_stale, installed
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.live import sync_cache
from perfect_bvh_addon.live.sync_cache import clear_syncs, sync_of, syncs_of


def test_each_scene_layer_and_kind_has_its_own_sync(scene: Any) -> None:
    mesh_object("a")
    camera_object()
    clear_syncs()
    viewport = sync_of(evaluated())
    assert sync_of(evaluated()) is viewport
    render = in_render(sync_of)
    assert render is not viewport
    assert in_render(sync_of) is render
    assert syncs_of(scene) == (viewport, render)
    other = bpy.data.scenes.new("other")
    assert syncs_of(other) == ()
    with bpy.context.temp_override(scene=other, view_layer=other.view_layers[0]):
        others = sync_of(bpy.context.evaluated_depsgraph_get())
    assert syncs_of(other) == (others,) and others not in (viewport, render)
    clear_syncs()
    assert syncs_of(scene) == syncs_of(other) == ()


def test_a_cached_sync_needs_only_the_difference_for_the_next_render(scene: Any) -> None:
    obj = mesh_object("a")
    camera_object()
    clear_syncs()

    def render(depsgraph: Any) -> Any:
        return sync_of(depsgraph).update(depsgraph)

    first = in_render(render)
    obj.location.x = 1.0
    second = in_render(render)
    assert [item.action for item in first.commit.meshes] == ["built"]
    assert second.commit.meshes == ()
    assert (second.moved_count, second.added_count) == (1, 0)


def test_loading_a_file_clears_the_cached_syncs_once_the_add_on_is_registered(scene: Any) -> None:
    mesh_object("a")
    sync_cache.register()
    try:
        cached = sync_of(evaluated())
        cached.update(evaluated())
        bpy.ops.wm.read_factory_settings(use_empty=True)
        assert_stale(cached, "closed")
        assert sync_of(evaluated()) is not cached
    finally:
        sync_cache.unregister()
    gc.collect()
    assert installed() == 0


def test_cached_syncs_go_with_their_scenes_and_layers(scene: Any, keeps_syncs: None) -> None:
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
    scene: Any, keeps_syncs: None, monkeypatch: pytest.MonkeyPatch
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
    three = update(third)  # `two` was the least recently used
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
