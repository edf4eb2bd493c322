"""The tree overlay without a screen: which boxes it takes from which tree, where it puts them, how it colours them."""

from __future__ import annotations

import sys
import time
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh  # noqa: E402
from blender.long_builds import PATIENCE, Gate, building_threads  # noqa: E402
from perfect_bvh_addon.events.changes import listen, stop_listening  # noqa: E402
from perfect_bvh_addon.live import pending_commit  # noqa: E402
from perfect_bvh_addon.live.sync_cache import sync_of  # noqa: E402
from perfect_bvh_addon.settings import editors, overlay_settings  # noqa: E402
from perfect_bvh_addon.view3d.box_lines import RAMP, box_lines, shares  # noqa: E402
from perfect_bvh_addon.view3d.tree_overlay import scene_overlay, tree_lines  # noqa: E402

pytestmark = pytest.mark.usefixtures("scene", "registered")


@pytest.fixture
def drawn_batches(monkeypatch) -> list:
    """What would be drawn: no graphics card is needed to follow a scene."""
    made: list = []

    def keep(lines):
        made.append(lines)
        return object()

    monkeypatch.setattr(tree_lines, "_make_batch", keep)
    monkeypatch.setattr(pending_commit, "BUILDING_SECONDS", 60.0)  # however slow this machine is
    return made


def synced():
    sync = sync_of(bpy.context.evaluated_depsgraph_get())
    sync.update(bpy.context.evaluated_depsgraph_get())
    return sync


def boxes_of(snapshot: perfect_bvh.Snapshot, **options) -> perfect_bvh.TreeBoxes:
    return snapshot.tree_boxes(**options)


def test_lines_join_the_corners_of_each_box() -> None:
    bpy.ops.mesh.primitive_uv_sphere_add()
    snapshot = synced().scene.snapshot()
    boxes = boxes_of(snapshot, mesh=0)
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
    boxes = boxes_of(synced().scene.snapshot(), mesh=0)
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
    whole = boxes_of(snapshot, mesh=0)
    boxes, level = tree_lines.list_levels(snapshot, 0, whole.depth, False)
    assert level == whole.depth and len(set(boxes.levels)) > 1
    assert len(boxes) == (whole.leaf_sizes > 0).sum() and boxes.leaf_sizes.sum() == len(whole.primitives)


def test_lines_are_made_again_only_when_the_boxes_change(scene, drawn_batches) -> None:
    bpy.ops.mesh.primitive_monkey_add()
    obj = bpy.context.object
    settings = scene.perfect_bvh.overlay
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
    scene.perfect_bvh.overlay.level, scene.perfect_bvh.overlay.use_all_to_level = 64, True
    lines = tree_lines.TreeLines()
    lines.follow(synced().scene.snapshot(), 0, scene.perfect_bvh.overlay)
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
    np.testing.assert_allclose(boxes_of(sync.scene.snapshot(), mesh=mesh).boxes[0], [[-1.0] * 3, [1.0] * 3])
    empty = bpy.data.objects.new("Empty", None)
    scene.collection.objects.link(empty)
    assert scene_overlay.find_object(synced(), empty) is None
    assert scene_overlay.find_object(synced(), None) is None


def test_a_redraw_goes_through_no_boxes_and_no_objects(scene, drawn_batches, monkeypatch) -> None:
    bpy.ops.mesh.primitive_monkey_add()
    settings = scene.perfect_bvh.overlay
    settings.show_top_level = settings.show_active = True
    asked = []
    for module, name in ((scene_overlay, "find_object"), (tree_lines, "list_levels"), (tree_lines, "are_equal")):
        whole = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *args, whole=whole, name=name: asked.append(name) or whole(*args))
    shown = scene_overlay.SceneOverlay()
    listen(shown)
    assert shown._follow(bpy.context, settings)
    assert asked.count("find_object") == 1 and "list_levels" in asked
    asked.clear()
    for _ in range(3):
        assert shown._follow(bpy.context, settings)
        assert len(shown.sections(settings)) == 2
    assert not asked
    bpy.context.object.location.x = 2.0
    bpy.context.view_layer.update()
    assert shown._follow(bpy.context, settings)
    assert "find_object" in asked and shown._matrix[0, 3] == 2.0
    stop_listening(shown)


def test_what_a_script_changes_is_drawn(scene) -> None:
    """Without a window nothing can be drawn, but the properties can be asked whom they tell."""
    settings = scene.perfect_bvh.overlay
    redrawn = []
    area = SimpleNamespace(type="VIEW_3D", tag_redraw=lambda: redrawn.append(1))
    windows = [SimpleNamespace(screen=SimpleNamespace(areas=[area, SimpleNamespace(type="PROPERTIES")]))]
    editors.redraw_for_setting(settings, SimpleNamespace(window_manager=SimpleNamespace(windows=windows)))
    assert redrawn == [1]
    called = []
    code = editors.redraw_for_setting.__code__
    changes = {
        "show_top_level": True,
        "show_active": True,
        "level": 5,
        "use_all_to_level": True,
        "color_by": "COST",
        "use_in_front": True,
    }
    assert set(changes) == set(overlay_settings.PERFECT_BVH_PG_overlay.__annotations__)
    sys.setprofile(lambda frame, event, _: called.append(1) if event == "call" and frame.f_code is code else None)
    try:
        for name, value in changes.items():
            before = len(called)
            setattr(settings, name, value)
            assert len(called) == before + 1, name
    finally:
        sys.setprofile(None)


def test_it_follows_frames_and_forgets_files(scene, drawn_batches) -> None:
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    for frame, x in ((1, 0.0), (10, 9.0)):
        cube.location.x = x
        cube.keyframe_insert("location", frame=frame)
    settings = scene.perfect_bvh.overlay
    settings.show_top_level = settings.show_active = True
    settings.level = 0
    shown = scene_overlay.SceneOverlay()
    listen(shown)
    for frame, x in ((1, 0.0), (10, 9.0)):
        scene.frame_set(frame)
        shown._follow(bpy.context, settings)
        top = shown.top_level.boxes.boxes[0]
        np.testing.assert_allclose(top, [[x - 1.0, -1.0, -1.0], [x + 1.0, 1.0, 1.0]], atol=1e-3)
        assert shown._matrix[0, 3] == pytest.approx(x)
    count = len(drawn_batches)
    shown._follow(bpy.context, settings)
    assert len(drawn_batches) == count
    bpy.ops.wm.read_factory_settings(use_empty=True)
    settings = bpy.context.scene.perfect_bvh.overlay
    settings.show_top_level = settings.show_active = True
    shown._follow(bpy.context, settings)
    assert shown.active is None and shown.top_level.shown.count == 0
    stop_listening(shown)


def test_it_follows_edits_although_somebody_removed_its_handlers(scene, drawn_batches) -> None:
    bpy.ops.mesh.primitive_cube_add()
    settings = scene.perfect_bvh.overlay
    settings.show_top_level, settings.level = True, 0
    shown = scene_overlay.SceneOverlay()
    listen(shown)
    for z in (0.0, 2.0):
        bpy.context.object.location.z = z
        bpy.context.view_layer.update()
        shown._follow(bpy.context, settings)
        np.testing.assert_allclose(shown.top_level.boxes.boxes[0, :, 2], [z - 1.0, z + 1.0], atol=1e-3)
        bpy.app.handlers.depsgraph_update_post.clear()
    stop_listening(shown)


class Screen:
    """A graphics card that keeps the lines that are drawn, in order."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.drawn: list[Any] = []
        state = {f"{name}_set": lambda _: None for name in ("blend", "depth_test", "depth_mask")}
        gpu = SimpleNamespace(
            state=SimpleNamespace(**state),
            matrix=SimpleNamespace(push_pop=nullcontext, multiply_matrix=lambda _: None),
            shader=SimpleNamespace(from_builtin=lambda name: name),
        )
        monkeypatch.setitem(sys.modules, "gpu", gpu)
        monkeypatch.setattr(tree_lines, "_make_batch", self._batch_of)

    def _batch_of(self, lines: Any) -> SimpleNamespace:
        return SimpleNamespace(draw=lambda shader: self.drawn.append(lines))

    def take(self) -> tuple[list[float], bool]:
        """How high the drawn boxes reach, and whether they all are grey."""
        drawn, self.drawn = self.drawn, []
        greys = {bool((lines.colors == np.float32(tree_lines.GREY)).all()) for lines in drawn}
        assert len(greys) <= 1
        return [round(float(lines.positions[:, 2].max()), 3) for lines in drawn], greys == {True}


def test_the_last_boxes_are_drawn_in_grey_until_the_new_ones_are_there(scene, monkeypatch, gate: Gate) -> None:
    monkeypatch.setattr(pending_commit, "BUILDING_SECONDS", 0.05)
    screen = Screen(monkeypatch)
    bpy.ops.mesh.primitive_cube_add()
    settings = scene.perfect_bvh.overlay
    settings.show_top_level = settings.show_active = True
    settings.level = 0
    shown = scene_overlay.SceneOverlay()
    listen(shown)
    shown.draw(bpy.context, settings)
    assert screen.take() == ([], False), "there are none yet"
    gate.open()

    def draw_what_is_there() -> tuple[list[float], bool]:
        assert sync_of(bpy.context.evaluated_depsgraph_get()).building is None or shown._trees._building.wait(PATIENCE)
        screen.take()
        shown.draw(bpy.context, settings)
        return screen.take()

    assert draw_what_is_there() == ([1.0, 1.0], False)
    gate.close()
    bpy.context.object.location.z = 3.0
    bpy.context.view_layer.update()
    held = gate.held
    shown.draw(bpy.context, settings)
    gate.wait_until_held(held + 1)
    screen.take()
    for _ in range(2):
        shown.draw(bpy.context, settings)
        assert shown.message == "Building trees 50%"
        assert screen.take() == ([1.0, 1.0], True)
    settings.show_active = False
    shown.draw(bpy.context, settings)
    assert screen.take() == ([1.0], True), "only what is asked for"
    gate.open()
    assert draw_what_is_there() == ([4.0], False)
    gate.close()
    shown.on_file_change()
    shown.draw(bpy.context, settings)
    assert screen.take() == ([], False), "those of another file are gone"
    stop_listening(shown)


def test_no_frame_of_an_animation_that_plays_shows_the_boxes_of_another(scene, monkeypatch) -> None:
    """Not in grey either: each frame waits for its trees, however long that takes."""
    monkeypatch.setattr(pending_commit, "BUILDING_SECONDS", 0.0)
    commit = perfect_bvh.Scene.commit

    def commit_slowly(*arguments: Any, **options: Any) -> Any:
        time.sleep(0.1)
        return commit(*arguments, **options)

    monkeypatch.setattr(perfect_bvh.Scene, "commit", commit_slowly)
    screen = Screen(monkeypatch)
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    for frame, z in ((1, 0.0), (3, 4.0)):
        cube.location.z = z
        cube.keyframe_insert("location", frame=frame)
    settings = scene.perfect_bvh.overlay
    settings.show_top_level, settings.level = True, 0
    shown = scene_overlay.SceneOverlay()
    listen(shown)
    for frame in (1, 2, 3, 1):
        scene.frame_set(frame)
        shown.draw(PlayingContext(), settings)
        assert screen.take() == ([round(cube.matrix_world.translation.z + 1.0, 3)], False)
        assert not shown.message
    stop_listening(shown)


class PlayingContext:
    """Of a window in which an animation plays."""

    screen = SimpleNamespace(is_animation_playing=True)

    def __getattr__(self, name: str) -> Any:
        return getattr(bpy.context, name)


def test_boxes_wait_for_trees_that_take_long_and_blender_for_neither(drawn_batches, monkeypatch) -> None:
    monkeypatch.setattr(pending_commit, "BUILDING_SECONDS", 0.05)
    gate = Gate(monkeypatch)
    bpy.ops.mesh.primitive_uv_sphere_add()
    settings = bpy.context.scene.perfect_bvh.overlay
    settings.show_top_level = True
    shown = scene_overlay.SceneOverlay()
    shown.draw(bpy.context, settings)
    gate.wait_until_held()
    shown.draw(bpy.context, settings)
    assert shown.message == "Building trees 50%"
    assert bpy.app.timers.is_registered(scene_overlay.redraw_viewports)
    assert not drawn_batches
    assert building_threads() == 1
    gate.open()
    while not shown._follow(bpy.context, settings):
        pass
    assert len(drawn_batches) == 1
    np.testing.assert_array_equal(
        drawn_batches[0].positions, box_lines(boxes_of(synced().scene.snapshot(), last_level=0), "LEVEL").positions
    )
