"""The tree overlay without a screen: the choice of trees and boxes, the boxes' positions, and their colours."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.drawn_texts import viewport_overlay  # noqa: E402
from blender.followed_trees import synced  # noqa: E402
from perfect_bvh_addon.settings import preferences, view_settings  # noqa: E402
from perfect_bvh_addon.view3d.drawing import RAMP, box_lines, shares  # noqa: E402
from perfect_bvh_addon.view3d.tree_overlay import scene_overlay, tree_lines  # noqa: E402

pytestmark = pytest.mark.usefixtures("scene", "registered")


def test_lines_join_the_corners_of_each_box() -> None:
    bpy.ops.mesh.primitive_uv_sphere_add()
    snapshot = synced().scene.snapshot()
    boxes = snapshot.tree_boxes(mesh=0)
    lines = box_lines(boxes, "LEVEL")
    assert (len(lines.positions), len(lines.colors), len(lines.lines)) == (
        8 * len(boxes),
        8 * len(boxes),
        12 * len(boxes),
    )
    corners = lines.positions.reshape(-1, 8, 3)
    np.testing.assert_array_equal(corners.min(axis=1), boxes.boxes[:, 0].astype(np.float32))
    np.testing.assert_array_equal(corners.max(axis=1), boxes.boxes[:, 1].astype(np.float32))
    ends = lines.positions[lines.lines]
    assert ((ends[:, 0] != ends[:, 1]).sum(axis=1) <= 1).all()  # along one axis each
    np.testing.assert_array_equal(lines.lines // 8, np.repeat(np.arange(len(boxes)), 12)[:, None].repeat(2, axis=1))
    sizes = boxes.boxes[:, 1] - boxes.boxes[:, 0]
    lengths = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).reshape(-1, 12).sum(axis=1)
    np.testing.assert_allclose(lengths, 4.0 * sizes.sum(axis=1), rtol=1e-5)


def test_colours_run_from_least_to_most() -> None:
    bpy.ops.mesh.primitive_monkey_add()
    boxes = synced().scene.snapshot().tree_boxes(mesh=0)
    for color_by, values in (("LEVEL", boxes.levels), ("OVERLAP", boxes.overlaps), ("COST", boxes.costs)):
        places = shares(boxes, color_by)
        assert places.min() >= 0.0 and places.max() <= 1.0
        assert (np.diff(places[np.argsort(values, kind="stable")]) >= 0.0).all()
    first = box_lines(boxes, "LEVEL").colors[0]
    np.testing.assert_allclose(first[:3], RAMP[0])
    np.testing.assert_allclose(box_lines(boxes, "COST").colors[8 * int(boxes.costs.argmax())][:3], RAMP[-1])


def test_a_level_beyond_the_deepest_is_the_deepest() -> None:
    bpy.ops.mesh.primitive_uv_sphere_add()
    snapshot = synced().scene.snapshot()
    boxes, level = tree_lines.list_levels(snapshot, 0, 40, False)
    assert level == boxes.depth == boxes.levels.max()
    boxes, level = tree_lines.list_levels(snapshot, 0, 1, True)
    assert (level, set(boxes.levels)) == (1, {0, 1})


def test_a_level_is_a_cut() -> None:
    bpy.ops.mesh.primitive_monkey_add()
    snapshot = synced().scene.snapshot()
    whole = snapshot.tree_boxes(mesh=0)
    boxes, level = tree_lines.list_levels(snapshot, 0, whole.depth, False)
    assert level == whole.depth and len(set(boxes.levels)) > 1
    assert len(boxes) == (whole.leaf_sizes > 0).sum() and boxes.leaf_sizes.sum() == len(whole.primitives)


def test_lines_are_made_again_only_when_the_boxes_change(scene, drawn_batches) -> None:
    bpy.ops.mesh.primitive_monkey_add()
    obj = bpy.context.object
    settings = viewport_overlay()
    lines = tree_lines.TreeLines()

    def follow() -> int:
        sync = synced()
        lines.follow(sync.scene.snapshot(), scene_overlay.find_object(sync, obj)[0], settings)
        return len(drawn_batches)

    assert follow() == follow() == 1
    obj.location.x = 3.0  # the object moves, its own tree does not change
    assert follow() == 1
    obj.data.vertices[0].co.x += 0.5
    obj.data.update()
    assert follow() == 2
    settings.color_by = "COST"
    assert follow() == 3
    settings.level = 0
    assert follow() == 4
    shown, boxes = lines.shown, lines.boxes
    assert (shown.level, shown.first_level, shown.count, shown.total) == (0, 0, 1, 1)
    assert (shown.depth, shown.sah, shown.built_sah) == (boxes.depth, boxes.sah, boxes.built_sah)


def test_it_shows_no_more_boxes_than_can_be_seen(scene, drawn_batches, monkeypatch) -> None:
    monkeypatch.setattr(tree_lines, "MOST_BOXES", 5)
    bpy.ops.mesh.primitive_monkey_add()
    settings = viewport_overlay()
    settings.level, settings.use_all_to_level = 64, True
    lines = tree_lines.TreeLines()
    lines.follow(synced().scene.snapshot(), 0, settings)
    assert lines.shown.count == 5 < lines.shown.total
    assert len(drawn_batches[0].positions) == 5 * 8


def test_the_active_object_is_found_where_it_stands(scene) -> None:
    bpy.ops.mesh.primitive_cube_add(location=(1.0, 2.0, 3.0), rotation=(0.3, 0.2, 0.1))
    cube = bpy.context.object
    cube.scale = (1.0, 2.0, -1.0)
    bpy.ops.mesh.primitive_monkey_add()
    bpy.context.view_layer.update()
    sync = synced()
    mesh, matrix = scene_overlay.find_object(sync, cube)
    np.testing.assert_allclose(matrix, np.array(cube.matrix_world), atol=1e-6)
    np.testing.assert_allclose(sync.scene.snapshot().tree_boxes(mesh=mesh).boxes[0], [[-1.0] * 3, [1.0] * 3])
    empty = bpy.data.objects.new("Empty", None)
    scene.collection.objects.link(empty)
    assert scene_overlay.find_object(synced(), empty) is None
    assert scene_overlay.find_object(synced(), None) is None


def test_a_redraw_goes_through_no_boxes_and_no_objects(scene, drawn_batches, monkeypatch, overlay) -> None:
    bpy.ops.mesh.primitive_monkey_add()
    settings = viewport_overlay()
    settings.show_top_level = settings.show_active = True
    asked = []
    for module, name in ((scene_overlay, "find_object"), (tree_lines, "list_levels"), (tree_lines, "are_equal")):
        whole = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *args, whole=whole, name=name: asked.append(name) or whole(*args))
    assert overlay._follow(bpy.context, settings)
    assert asked.count("find_object") == 1 and "list_levels" in asked
    asked.clear()
    for _ in range(3):
        assert overlay._follow(bpy.context, settings)
        assert len(overlay.sections(settings)) == 2
    assert not asked
    bpy.context.object.location.x = 2.0
    bpy.context.view_layer.update()
    assert overlay._follow(bpy.context, settings)
    assert "find_object" in asked and overlay._matrix[0, 3] == 2.0


def test_what_a_script_changes_is_drawn(scene) -> None:
    """Without a window nothing can be drawn, but the update functions of the properties can be called."""
    settings = viewport_overlay()
    redrawn = []
    area = SimpleNamespace(type="VIEW_3D", tag_redraw=lambda: redrawn.append(1))
    windows = [SimpleNamespace(screen=SimpleNamespace(areas=[area, SimpleNamespace(type="PROPERTIES")]))]
    preferences.redraw_for_setting(settings, SimpleNamespace(window_manager=SimpleNamespace(windows=windows)))
    assert redrawn == [1]
    called = []
    code = preferences.redraw_for_setting.__code__
    changes = {
        "show_top_level": True,
        "show_active": True,
        "level": 5,
        "use_all_to_level": True,
        "color_by": "COST",
        "use_in_front": True,
    }
    assert set(changes) == set(view_settings.PERFECT_BVH_PG_overlay.__annotations__)
    sys.setprofile(lambda frame, event, _: called.append(1) if event == "call" and frame.f_code is code else None)
    try:
        for name, value in changes.items():
            before = len(called)
            setattr(settings, name, value)
            assert len(called) == before + 1, name
    finally:
        sys.setprofile(None)


def test_it_follows_frames_and_forgets_files(scene, drawn_batches, overlay) -> None:
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    for frame, x in ((1, 0.0), (10, 9.0)):
        cube.location.x = x
        cube.keyframe_insert("location", frame=frame)
    settings = viewport_overlay()
    settings.show_top_level = settings.show_active = True
    settings.level = 0
    for frame, x in ((1, 0.0), (10, 9.0)):
        scene.frame_set(frame)
        overlay._follow(bpy.context, settings)
        top = overlay.top_level.boxes.boxes[0]
        np.testing.assert_allclose(top, [[x - 1.0, -1.0, -1.0], [x + 1.0, 1.0, 1.0]], atol=1e-3)
        assert overlay._matrix[0, 3] == pytest.approx(x)
    count = len(drawn_batches)
    overlay._follow(bpy.context, settings)
    assert len(drawn_batches) == count
    bpy.ops.wm.read_factory_settings(use_empty=True)
    settings = viewport_overlay()
    settings.show_top_level = settings.show_active = True
    overlay._follow(bpy.context, settings)
    assert overlay.active is None and overlay.top_level.shown.count == 0


def test_it_follows_edits_although_somebody_removed_its_handlers(scene, drawn_batches, overlay) -> None:
    bpy.ops.mesh.primitive_cube_add()
    settings = viewport_overlay()
    settings.show_top_level, settings.level = True, 0
    for z in (0.0, 2.0):
        bpy.context.object.location.z = z
        bpy.context.view_layer.update()
        overlay._follow(bpy.context, settings)
        np.testing.assert_allclose(overlay.top_level.boxes.boxes[0, :, 2], [z - 1.0, z + 1.0], atol=1e-3)
        bpy.app.handlers.depsgraph_update_post.clear()
