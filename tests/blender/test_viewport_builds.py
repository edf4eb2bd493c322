"""Rendered viewports whose trees take long: they keep their image, report progress, and show the newest reading."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh  # noqa: E402
from blender.long_builds import PATIENCE, Gate, building_threads  # noqa: E402
from blender.shown_viewport import Shown, cube_to_show, fresh, move  # noqa: E402
from perfect_bvh_addon import engine  # noqa: E402
from perfect_bvh_addon.live import pending_commit  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs, sync_of  # noqa: E402
from perfect_bvh_addon.view3d.rendered import viewport  # noqa: E402

pytestmark = pytest.mark.usefixtures("without_windows")


@pytest.fixture
def gate(gate: Gate) -> Gate:
    gate.open()
    return gate


@pytest.fixture
def cube(scene: bpy.types.Scene) -> bpy.types.Object:
    return cube_to_show(scene)


def test_an_image_of_quick_trees_comes_in_the_redraw_of_the_edit(cube, gate: Gate, monkeypatch) -> None:
    monkeypatch.setattr(pending_commit, "BUILDING_SECONDS", PATIENCE)  # does not depend on the machine's speed
    shown = Shown()
    for x in (0.0, 1.0):
        move(cube, x)
        shown.update()
        shown.redraw()
        assert len(shown.screen) == 1, "nothing was drawn at once"
        np.testing.assert_array_equal(shown.finish(), fresh())
        shown.screen.clear()


def test_trees_that_take_long_are_built_beside_it(cube, gate: Gate) -> None:
    shown = Shown()
    gate.close()
    shown.update()
    gate.wait_until_held()
    for _ in range(5):
        assert shown.redraw()
        assert shown.viewport.state == "Building BVHs 50%"
    assert shown.screen == []
    gate.open()
    np.testing.assert_array_equal(shown.finish(), fresh())
    assert shown.viewport.state == "Done (2 samples)"


def test_trees_of_a_filter_that_is_lifted_are_built_no_further(cube, gate: Gate, monkeypatch) -> None:
    begin_view = viewport.begin_view
    unfiltered = lambda sync, depsgraph, plan, _: begin_view(sync, depsgraph, plan, None)  # noqa: E731
    monkeypatch.setattr(viewport, "begin_view", unfiltered)
    shown = Shown()
    gate.close()
    shown.context.space_data.show_object_viewport_curve = False
    shown.update()
    building = shown.viewport._own_sync.building
    assert building is not None
    shown.context.space_data.show_object_viewport_curve = True
    shown.update()
    with pytest.raises(perfect_bvh.Cancelled):
        building.result()
    assert sync_of(bpy.context.evaluated_depsgraph_get()).building is not None
    gate.open()
    np.testing.assert_array_equal(shown.finish(), fresh())


def test_another_sync_at_the_same_address_is_another(cube, gate: Gate, monkeypatch) -> None:
    """Python reuses addresses: a dropped sync and its successor may both be at their first update."""
    monkeypatch.setattr(viewport, "id", lambda _: 7, raising=False)
    shown = Shown()
    shown.update()
    first = shown.finish()
    clear_syncs()
    move(cube, 2.0)
    shown.update()
    np.testing.assert_array_equal(shown.finish(), fresh())
    assert not np.array_equal(shown.screen[-1], first)


@pytest.mark.parametrize("modes", [("CLAY", "PREVIEW"), ("DEPTH", "UV"), ("DEPTH", "MATERIAL"), ("PREVIEW", "CLAY")])
def test_a_mode_that_needs_more_has_it_read(cube, scene, gate: Gate, modes: tuple[str, str]) -> None:
    """Blender's depsgraph does not report changes of the add-on's settings, and no other event may cause an update."""
    bpy.ops.object.light_add(type="SUN")
    bpy.context.view_layer.objects.active = cube
    cube.data.materials.append(bpy.data.materials.new("red"))
    bpy.context.view_layer.update()
    shown = Shown()
    for scene.perfect_bvh.mode in modes:
        if shown.screen == []:
            shown.update()
        np.testing.assert_array_equal(shown.finish(), fresh())


def test_the_last_image_stays_until_the_next_is_there(cube, gate: Gate) -> None:
    shown = Shown()
    shown.update()
    before = shown.finish()
    gate.close()
    move(cube, 1.5)
    shown.update()
    shown.screen.clear()
    assert all(shown.redraw() for _ in range(3))
    assert all(np.array_equal(drawn, before) for drawn in shown.screen) and len(shown.screen) == 3
    gate.open()
    after = shown.finish()
    assert abs(after - before).max() > 0.1 * before[..., :3].max()
    np.testing.assert_array_equal(after, fresh())


def test_further_edits_restart_it(cube, gate: Gate) -> None:
    shown = Shown()
    gate.close()
    builds = []
    for x in (0.0, 0.5, 1.0):
        move(cube, x)
        shown.update()
        shown.redraw()
        builds.append(sync_of(bpy.context.evaluated_depsgraph_get()).building)
    assert [build.is_running for build in builds] == [False, False, True]
    shown.update()
    assert builds[-1].is_running, "nothing was edited, and yet it restarted"
    gate.open()
    np.testing.assert_array_equal(shown.finish(), fresh())


def test_viewports_that_share_the_trees_wait_for_the_same(cube, gate: Gate) -> None:
    first, second = Shown(), Shown()
    gate.close()
    for shown in (first, second):
        shown.update()
    gate.wait_until_held()
    assert gate.held == building_threads() == 1
    move(cube, 1.0)
    second.update()
    gate.wait_until_held(2)
    for shown in (first, second):
        assert shown.redraw()
        assert shown.viewport.state == "Building BVHs 50%"
    assert building_threads() == 1
    gate.open()
    expected = fresh()
    for shown in (first, second):
        np.testing.assert_array_equal(shown.finish(), expected)


def test_a_view_without_updates_waits_for_what_another_has_begun(cube, gate: Gate) -> None:
    """The Preview button, for example, may request attributes, which makes the scene stale."""
    first, second = Shown(), Shown()
    first.update()
    before = first.finish()
    gate.close()
    move(cube, 1.0)
    second.update()
    gate.wait_until_held()
    assert first.redraw()
    assert first.viewport.state == "Building BVHs 50%"
    np.testing.assert_array_equal(first.screen[-1], before)
    gate.open()
    np.testing.assert_array_equal(first.finish(), fresh())


def test_what_one_gives_up_is_restarted(cube, gate: Gate) -> None:
    shown = Shown()
    gate.close()
    shown.update()
    assert shown.redraw()
    sync_of(bpy.context.evaluated_depsgraph_get()).stop_building()
    assert shown.redraw()
    assert shown.viewport.state.startswith("Building BVHs")
    gate.open()
    np.testing.assert_array_equal(shown.finish(), fresh())


def test_a_sync_that_was_closed_is_replaced(cube, gate: Gate) -> None:
    shown = Shown()
    shown.update()
    shown.finish()
    gate.close()
    move(cube, 1.0)
    shown.update()
    clear_syncs()
    assert not building_threads()
    gate.open()
    np.testing.assert_array_equal(shown.finish(), fresh())


def test_playback_shows_each_frame_that_it_reads(cube, gate: Gate) -> None:
    shown = Shown()
    shown.context.screen.is_animation_playing = True
    for frame, x in ((1, 0.0), (2, 1.5)):
        cube.location.x = x
        cube.keyframe_insert("location", frame=frame)
    for frame in (1, 2, 1):
        bpy.context.scene.frame_set(frame)
        gate.close()
        opening = threading.Timer(0.4, gate.open)
        opening.start()
        shown.update()
        opening.join()
        shown.redraw()
        assert "Building" not in shown.viewport.state
        np.testing.assert_array_equal(shown.finish(), fresh())


def test_what_fails_beside_it_is_told_and_leaves_no_old_image(cube, gate: Gate, monkeypatch) -> None:
    shown = Shown()
    shown.update()
    shown.finish()
    move(cube, 1.0)
    may_fail = threading.Event()
    commit = perfect_bvh.Scene.commit

    def fail(self: Any, *_: object, **__: object) -> None:
        assert may_fail.wait(PATIENCE)
        raise MemoryError("no room for trees")

    monkeypatch.setattr(perfect_bvh.Scene, "commit", fail)
    shown.update()
    assert shown.redraw()
    may_fail.set()
    building = sync_of(bpy.context.evaluated_depsgraph_get()).building
    assert building is None or building.wait(PATIENCE)
    shown.screen.clear()
    monkeypatch.setattr(pending_commit, "BUILDING_SECONDS", PATIENCE)  # the restarted build fails before the wait
    for _ in range(2):
        with pytest.raises(MemoryError, match="no room for trees"):
            shown.redraw()
    assert shown.screen == []
    monkeypatch.setattr(perfect_bvh.Scene, "commit", commit)
    np.testing.assert_array_equal(shown.finish(), fresh())


def test_a_viewport_tells_in_one_line_what_it_does_not_show(cube, gate: Gate) -> None:
    shown, told = Shown(), []
    screen = SimpleNamespace(
        _can_view=lambda: True,
        _viewport=lambda: shown.viewport,
        _attempt=lambda scene, work: work(),
        _tell_of_view=lambda scene, text: None,
        append=shown.screen.append,
        update_stats=lambda line, state: told.append(line),
        tag_redraw=lambda: None,
    )

    def redraw() -> str:
        depsgraph = bpy.context.evaluated_depsgraph_get()
        shown.viewport.update(shown.context, depsgraph)
        engine.PerfectBVHRenderEngine.view_draw(screen, shown.context, depsgraph)
        return told[-1]

    assert redraw() == ""
    bpy.context.scene.cycles_curves.subdivisions = 9
    assert redraw() == "1 setting ignored"
    bpy.ops.object.volume_add()
    assert redraw() == "1 object not shown, 1 setting ignored"
    bpy.context.scene.world = None
    assert redraw() == "No light, 1 object not shown, 1 setting ignored"
    bpy.context.scene.perfect_bvh.mode = "CLAY"
    assert redraw() == "1 object not shown, 1 setting ignored"
    shown.viewport.complaint = None
    shown.finish()
