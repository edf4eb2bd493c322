"""The tree overlay during builds: the last boxes in grey, none of another frame, and Blender never waits."""

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
from blender.drawn_texts import viewport_overlay  # noqa: E402
from blender.followed_trees import synced  # noqa: E402
from blender.long_builds import PATIENCE, Gate, building_threads, wait_until  # noqa: E402
from perfect_bvh_addon.live import pending_commit  # noqa: E402
from perfect_bvh_addon.live.sync_cache import sync_of  # noqa: E402
from perfect_bvh_addon.view3d.drawing import box_lines  # noqa: E402
from perfect_bvh_addon.view3d.tree_overlay import scene_overlay, tree_lines  # noqa: E402

pytestmark = pytest.mark.usefixtures("scene", "registered")


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
        """Return the top of the drawn boxes, and whether all of them are grey."""
        drawn, self.drawn = self.drawn, []
        greys = {bool((lines.colors == np.float32(tree_lines.GREY)).all()) for lines in drawn}
        assert len(greys) <= 1
        return [round(float(lines.positions[:, 2].max()), 3) for lines in drawn], greys == {True}


def test_the_last_boxes_are_drawn_in_grey_until_the_new_ones_are_there(scene, monkeypatch, gate: Gate, overlay) -> None:
    monkeypatch.setattr(pending_commit, "BUILDING_SECONDS", 0.05)
    screen = Screen(monkeypatch)
    bpy.ops.mesh.primitive_cube_add()
    settings = viewport_overlay()
    settings.show_top_level = settings.show_active = True
    settings.level = 0
    overlay.draw(bpy.context, settings)
    assert screen.take() == ([], False), "there are none yet"
    gate.open()

    def draw_what_is_there() -> tuple[list[float], bool]:
        building = sync_of(bpy.context.evaluated_depsgraph_get()).building
        assert building is None or overlay._trees._building.wait(PATIENCE)
        screen.take()
        overlay.draw(bpy.context, settings)
        return screen.take()

    assert draw_what_is_there() == ([1.0, 1.0], False)
    gate.close()
    bpy.context.object.location.z = 3.0
    bpy.context.view_layer.update()
    held = gate.held
    overlay.draw(bpy.context, settings)
    gate.wait_until_held(held + 1)
    screen.take()
    for _ in range(2):
        overlay.draw(bpy.context, settings)
        assert overlay.message == "Building BVHs 50%"
        assert screen.take() == ([1.0, 1.0], True)
    settings.show_active = False
    overlay.draw(bpy.context, settings)
    assert screen.take() == ([1.0], True), "only what is asked for"
    gate.open()
    assert draw_what_is_there() == ([4.0], False)
    gate.close()
    overlay.on_file_change()
    overlay.draw(bpy.context, settings)
    assert screen.take() == ([], False), "those of another file are gone"


def test_no_frame_of_an_animation_that_plays_shows_the_boxes_of_another(scene, monkeypatch, overlay) -> None:
    """Old boxes are not shown in grey either: each frame waits for its trees."""
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
    settings = viewport_overlay()
    settings.show_top_level, settings.level = True, 0
    for frame in (1, 2, 3, 1):
        scene.frame_set(frame)
        overlay.draw(PlayingContext(), settings)
        assert screen.take() == ([round(cube.matrix_world.translation.z + 1.0, 3)], False)
        assert not overlay.message


class PlayingContext:
    """The context of a window in which an animation plays."""

    screen = SimpleNamespace(is_animation_playing=True)

    def __getattr__(self, name: str) -> Any:
        return getattr(bpy.context, name)


def test_boxes_wait_for_trees_that_take_long_and_blender_for_neither(drawn_batches, monkeypatch) -> None:
    monkeypatch.setattr(pending_commit, "BUILDING_SECONDS", 0.05)
    gate = Gate(monkeypatch)
    bpy.ops.mesh.primitive_uv_sphere_add()
    settings = viewport_overlay()
    settings.show_top_level = True
    shown = scene_overlay.SceneOverlay()
    shown.draw(bpy.context, settings)
    gate.wait_until_held()
    shown.draw(bpy.context, settings)
    assert shown.message == "Building BVHs 50%"
    assert bpy.app.timers.is_registered(scene_overlay.redraw_viewports)
    assert not drawn_batches
    assert building_threads() == 1
    gate.open()
    wait_until(lambda: shown._follow(bpy.context, settings), "the trees are not there")
    assert len(drawn_batches) == 1
    np.testing.assert_array_equal(
        drawn_batches[0].positions, box_lines(synced().scene.snapshot().tree_boxes(last_level=0), "LEVEL").positions
    )
