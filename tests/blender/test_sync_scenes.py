"""Syncs of several scenes, view layers and depsgraphs at once, of linked objects, and of a rendered animation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import pytest
from blender.builders import SQUARE, camera_object, collection, evaluated, in_render, mesh_data, mesh_object
from blender.syncing import PASSED_OVER, deform, height, reasons
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.live.sync_cache import sync_of
from perfect_bvh_addon.sync.report import SyncReport


def test_switching_scenes_shows_each_its_own(scene: Any) -> None:
    """One sync follows the window; each scene has another one, which does not watch Blender."""
    mesh_object("a", mesh_data("a", *SQUARE), location=(0, 0, 1))
    other = bpy.data.scenes.new("other")
    there = bpy.data.objects.new("b", mesh_data("b", *SQUARE))
    there.location.z = 2.0
    other.collection.objects.link(there)
    follower, own = SceneSync(), {scene: SceneSync(watch=False), other: SceneSync(watch=False)}
    for _ in range(3):
        for shown, z in ((scene, 1.0), (other, 2.0)):
            bpy.context.window.scene = shown
            for sync in (follower, own[shown]):
                assert sync.update(evaluated(), verify=True).mismatches == ()
                assert height(sync) == z
    assert own[other].update(evaluated()).kept_count == 1
    for sync in (follower, *own.values()):
        sync.close()


def test_scenes_and_view_layers_side_by_side(scene: Any) -> None:
    """One scene is edited between updates of another. Each depends on its own evaluations, and both share a mesh."""
    shared = mesh_data("shared", *SQUARE)
    mesh_object("a", shared)
    layered = mesh_object("layered", mesh_data("layered", *SQUARE), collection=collection("only"))
    layered.location.x = 5.0
    other = bpy.data.scenes.new("other")
    other.collection.objects.link(bpy.data.objects.new("b", shared))
    second = scene.view_layers.new("second")
    second.layer_collection.children["only"].exclude = True
    window, places = bpy.context.window, ((scene, 0), (scene, 1), (other, 0))
    syncs = [SceneSync(), SceneSync(), SceneSync()]

    def show(place: int) -> Any:
        window.scene, layer = places[place]
        window.view_layer = window.scene.view_layers[layer]
        return evaluated()

    for step in range(1, 4):
        bpy.data.objects["a"].location.z = 1.0 * step
        bpy.data.objects["b"].location.z = 2.0 * step
        if step == 2:  # the mesh of both
            for vertex in shared.vertices:
                vertex.co.z = 0.5
            shared.update()
        lift = 0.5 if step >= 2 else 0.0
        for place in (0, 2, 1) if step % 2 else (1, 0, 2):
            report = syncs[place].update(show(place), verify=True)
            assert report.mismatches == ()
            expected = (2.0 if places[place][0] is other else 1.0) * step + lift
            assert height(syncs[place]) == pytest.approx(expected)
            assert syncs[place].scene.cast_rays([(5.2, 0.2, 10)], [(0, 0, -1)]).is_hit[0] == (place == 0)
    for sync in syncs:
        sync.close()


def test_two_depsgraphs_at_once(scene: Any, keeps_syncs: None) -> None:
    """The evaluations of a render say nothing about the viewport, and vice versa."""
    mesh_object("a", mesh_data("a", *SQUARE)).modifiers.new("m", "SOLIDIFY").show_render = False
    sync = SceneSync()
    for factor in (1.0, 2.0, 0.5):
        deform("a", factor)
        assert in_render(lambda depsgraph: sync.update(depsgraph, verify=True)).mismatches == ()
        assert sync.update(evaluated(), verify=True).mismatches == ()
        assert sync.update(evaluated(), verify=True).mismatches == ()
    sync.close()


def test_linked_objects_and_overrides(scene: Any, keeps_syncs: None, tmp_path: Path) -> None:
    """Objects come from another file, which is also reloaded after a change."""
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
def test_an_animation_syncs_what_changes(scene: Any, keeps_syncs: None, tmp_path: Path, persistent: bool) -> None:
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
