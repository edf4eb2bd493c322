"""Trees followed through an animation without a screen: what they cost, where curves stand, what a click means."""

from __future__ import annotations

import time
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import perfect_bvh
import pytest

bpy: Any = pytest.importorskip("bpy")

from blender.long_builds import ESCAPE, TIMER, FakeOperator, FakeWindow, wait_until  # noqa: E402
from perfect_bvh_addon.events.changes import edit_count  # noqa: E402
from perfect_bvh_addon.live.scene_reference import SceneReference  # noqa: E402
from perfect_bvh_addon.operators.decay import PERFECT_BVH_OT_decay  # noqa: E402
from perfect_bvh_addon.settings.tree_settings import frames_of  # noqa: E402
from perfect_bvh_addon.statistics import words  # noqa: E402
from perfect_bvh_addon.view3d import drawing  # noqa: E402
from perfect_bvh_addon.view3d.decay import decay_chart, decay_view  # noqa: E402
from perfect_bvh_addon.view3d.decay.chart_layout import (  # noqa: E402
    ChartLayout,
    cost_range,
    cost_ticks,
    frame_ticks,
    without_crowd,
)
from perfect_bvh_addon.view3d.decay.decay import POLICIES, Decay, follow  # noqa: E402
from perfect_bvh_addon.view3d.decay.decay_words import LABELS, heading_of, key_of, sentence_of, summary_of  # noqa: E402
from perfect_bvh_addon.view3d.reading import read_frames, read_object  # noqa: E402

pytestmark = pytest.mark.usefixtures("scene", "registered")
FRAMES = 6


@pytest.fixture
def twisted(scene: Any) -> Any:
    """A ball whose halves change places, over a plane that rests; the third frame is shown, and a half of the next."""
    bpy.ops.mesh.primitive_plane_add(size=8.0, location=(0, 0, -1.2))
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=4)
    ball = bpy.context.object
    ball.shape_key_add(name="rest")
    other = ball.shape_key_add(name="other")
    for point in other.data:
        if point.co.z > 0.0:
            point.co.x, point.co.y = -point.co.x, -point.co.y
    for frame, value in ((1, 0.0), (FRAMES, 1.0)):
        other.value = value
        other.keyframe_insert("value", frame=frame)
    scene.frame_start, scene.frame_end = 1, FRAMES
    scene.frame_set(3, subframe=0.5)
    return ball


def followed(obj: Any = None, rays: int = 1000) -> Decay:
    scene = bpy.context.scene
    decay = Decay("It", scene.session_uid, obj is None, frames_of(scene))
    read = read_frames(SceneReference("decay", scene, bpy.context.view_layer), obj)
    shares = [share for share, _ in follow(decay, read, rays)]
    assert shares == sorted(shares) and shares[0] == 0.0 and shares[-1] < 1.0
    return decay


def test_a_tree_that_is_only_refitted_decays(twisted: Any) -> None:
    decay = followed(twisted)
    assert [row.frame for row in decay.rows] == list(range(1, FRAMES + 1))
    costs = {policy: decay.costs(policy) for policy in POLICIES}
    assert costs["refit"][0] == costs["rebuild"][0] == costs["governed"][0]
    assert costs["refit"][2] > 1.2 * costs["rebuild"][2]
    actions = {policy: [row.policies[policy].action for row in decay.rows] for policy in POLICIES}
    assert set(actions["refit"][1:]) == {"refitted"} and set(actions["rebuild"][1:]) == {"rebuilt"}
    assert {values[0] for values in actions.values()} == {"built"}


def test_what_a_tree_costs_is_what_the_engine_says(twisted: Any) -> None:
    decay = followed(twisted)
    scenes = {policy: perfect_bvh.Scene(policy) for policy in ("refit", "rebuild")}
    meshes: dict[str, int] = {}
    for number, frame in enumerate(range(1, FRAMES + 1)):
        mesh = read_object(bpy.context, twisted, frame).mesh
        for policy, scene in scenes.items():
            if number:
                scene.update_mesh(meshes[policy], mesh.positions)
            else:
                meshes[policy] = scene.add_mesh(mesh.positions, mesh.triangles, usage="deforming")
                scene.add_instance(meshes[policy])
            scene.commit(expected_rays=1000)
            wanted = scene.snapshot().tree_boxes(meshes[policy]).costs.sum()
            assert decay.costs(policy)[number] == pytest.approx(wanted, rel=1e-4)


def test_the_more_rays_the_more_the_governor_rebuilds(twisted: Any) -> None:
    few, many = followed(twisted, 10), followed(twisted, 10**8)
    assert not few.rebuilds()
    assert many.rebuilds() and 0 not in many.rebuilds()
    assert few.costs("governed") == few.costs("refit")
    assert sum(many.costs("governed")) < sum(few.costs("governed"))
    row = many.rows[many.rebuilds()[0]]
    assert row.policies["governed"].reason in sentence_of(row).replace("Positions", "positions")


def test_of_a_scene_rays_tell_what_trees_cost(twisted: Any) -> None:
    decay = followed()
    assert decay.is_scene and decay.measure == "Visits per ray"
    refit, rebuild = decay.costs("refit"), decay.costs("rebuild")
    assert refit[0] == rebuild[0] and refit[2] > rebuild[2]
    one = decay.rows[2].policies["refit"]
    assert refit[2] == one.rays.nodes + one.rays.triangles


def test_an_object_without_triangles_has_no_decay(scene: Any) -> None:
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.data.clear_geometry()
    with pytest.raises(ValueError, match="no triangles"):
        followed(bpy.context.object)


def test_frames_are_those_that_the_scene_plays_unless_others_are_chosen(twisted: Any) -> None:
    scene = bpy.context.scene
    assert list(frames_of(scene)) == list(range(1, FRAMES + 1))
    scene.use_preview_range, scene.frame_preview_start, scene.frame_preview_end = True, 2, 4
    assert list(frames_of(scene)) == [2, 3, 4]
    settings = scene.perfect_bvh.decay
    settings.use_custom_range, settings.frame_start, settings.frame_end = True, 5, 6
    assert list(frames_of(scene)) == [5, 6]
    settings.frame_end = 4
    assert not bpy.ops.perfect_bvh.decay.poll()
    with pytest.raises(RuntimeError, match="before the first"):
        bpy.ops.perfect_bvh.decay()


# Places --------------------------------------------------------------------------------------------------------------


def test_a_place_of_the_chart_is_the_frame_that_stands_there() -> None:
    layout = ChartLayout(100.0, 20.0, 320.0, 80.0, 1, 33, 0.0, 50.0)
    frames = range(1, 34)
    for frame in frames:
        assert layout.frame_at(layout.place(frame, 3.0)[0] + 4.0, frames) == frame
    assert (layout.frame_at(-50.0, frames), layout.frame_at(9e9, frames)) == (1, 33)
    assert layout.frame_at(9e9, [1, 2, 3]) == 3  # no further than was measured
    assert layout.place(1, 0.0) == (100.0, 20.0) and layout.place(33, 50.0) == (420.0, 100.0)
    assert ChartLayout(0.0, 0.0, 10.0, 10.0, 7, 7, 0.0, 1.0).x_of(7) == 5.0


@pytest.mark.parametrize(
    ("costs", "low", "high"),
    [
        ([22.0, 80.0], 0.0, 80.0),
        ([34.5, 38.0], 34.0, 38.0),
        ([37.0, 38.0], 0.0, 40.0),
        ([5.0, 5.0], 0.0, 6.0),
        ([0.0, 0.0], 0.0, 1.0),
        ([], 0.0, 1.0),
    ],
)
def test_an_axis_ends_at_round_numbers(costs: list[float], low: float, high: float) -> None:
    assert cost_range(costs) == pytest.approx((low, high))
    ticks = cost_ticks(low, high)
    assert 2 <= len(ticks) <= 7 and ticks[0] == pytest.approx(low) and ticks[-1] <= high * (1 + 1e-9)


def test_frames_are_named_without_a_crowd() -> None:
    assert frame_ticks(1, 48, 6) == [1, 10, 20, 30, 40]
    assert frame_ticks(1, 4, 20) == [1, 2, 3, 4] and frame_ticks(7, 7, 5) == [7]
    layout = ChartLayout(0.0, 0.0, 470.0, 80.0, 1, 48, 0.0, 1.0)
    ticks = without_crowd(range(1, 49), layout, 39.5)
    assert ticks[0] == 1 and all(b - a == 4 for a, b in pairwise(ticks))


# The button ----------------------------------------------------------------------------------------------------------


def test_the_button_reports_and_shows_the_frame_again(twisted: Any) -> None:
    scene = bpy.context.scene
    bpy.context.view_layer.objects.active = twisted
    assert bpy.ops.perfect_bvh.decay() == {"FINISHED"}
    assert (scene.frame_current, scene.frame_subframe) == (3, 0.5)
    shown = decay_view.shown()
    assert shown is not None and len(shown.decay.rows) == FRAMES
    assert not decay_view.is_old(shown, scene), "it takes its own frames for edits"
    scene.frame_set(5)
    assert not decay_view.is_old(shown, scene)
    twisted.location.x += 1.0
    bpy.context.view_layer.update()
    assert decay_view.is_old(shown, scene)
    twisted.location.x += 1.0  # Blender has yet to evaluate it
    assert bpy.ops.perfect_bvh.decay() == {"FINISHED"}
    newer = decay_view.shown()
    assert newer is not None and not decay_view.is_old(newer, scene)
    assert bpy.ops.perfect_bvh.end_decay() == {"FINISHED"}
    assert decay_view.shown() is None and not bpy.ops.perfect_bvh.end_decay.poll()


def test_the_button_goes_on_beside_blender_and_escape_keeps_what_there_is(twisted: Any) -> None:
    scene = bpy.context.scene
    bpy.context.view_layer.objects.active = twisted
    operator, window = FakeOperator(PERFECT_BVH_OT_decay), FakeWindow()
    assert operator.invoke(window, None) == {"RUNNING_MODAL"}
    while len(operator._decay.rows) < 2:
        assert operator.modal(window, TIMER) == {"RUNNING_MODAL"}
        time.sleep(0.002)
    assert "Esc ends it" in window.status
    assert operator.modal(window, ESCAPE) == {"FINISHED"}
    assert 2 <= len(operator._decay.rows) < FRAMES
    assert (scene.frame_current, scene.frame_subframe) == (3, 0.5)
    assert window.status is None and window.timers == 0
    assert operator.reports[-1][1].startswith("SAH in the end: refitted ")


def test_escape_at_once_leaves_nothing(twisted: Any) -> None:
    bpy.context.view_layer.objects.active = twisted
    operator, window = FakeOperator(PERFECT_BVH_OT_decay), FakeWindow()
    operator.invoke(window, None)
    assert operator.modal(window, ESCAPE) == {"CANCELLED"}
    assert operator.reports == [("INFO", "Stopped before the first frame was measured")]


def test_it_ends_with_a_reason_where_the_object_is_removed_meanwhile(twisted: Any) -> None:
    bpy.context.view_layer.objects.active = twisted
    operator, window = FakeOperator(PERFECT_BVH_OT_decay), FakeWindow()
    operator.invoke(window, None)
    while not operator._decay.rows:
        operator.modal(window, TIMER)
        time.sleep(0.002)
    name = twisted.name
    bpy.data.objects.remove(twisted)
    wait_until(lambda: operator.modal(window, TIMER) != {"RUNNING_MODAL"}, "it goes on without its object")
    assert ("ERROR", f"{name} has no triangles that rays could meet in frame") == (
        operator.reports[0][0],
        operator.reports[0][1].rpartition(" ")[0],
    )
    assert bpy.context.scene.frame_current == 3


# What is shown -------------------------------------------------------------------------------------------------------


def test_words_tell_of_the_frame_that_is_shown(twisted: Any) -> None:
    decay = followed(twisted, 10)
    assert heading_of(decay) == f"Decay of It: SAH, {FRAMES} frames"
    assert heading_of(decay, is_old=True) == f"Decay of It: SAH, {FRAMES} frames (the scene has changed since)"
    assert key_of(decay, "refit", None) == LABELS["refit"]
    assert key_of(decay, "refit", 2) == f"{LABELS['refit']} {words.number(decay.costs('refit')[2], 3)}"
    assert sentence_of(decay.rows[1]).startswith("Frame 2: Refitted. Positions changed")
    assert summary_of(decay).endswith(f"What the governor did: refitted {FRAMES - 1}")


def test_a_click_shows_a_frame_and_the_chart_ends_with_its_file(twisted: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    decay = followed(twisted)
    scene = bpy.context.scene
    decay_view.show(decay, 7, edit_count(decay.scene_uid))
    context, other = (
        SimpleNamespace(scene=scene, area=None, region=None, space_data=SimpleNamespace(as_pointer=lambda it=it: it))
        for it in (7, 8)
    )
    assert decay_view.shown_in(context) is decay
    assert decay_view.shown_in(other) is None
    panel = drawing.Rect(50.0, 10.0, 750.0, 260.0)
    monkeypatch.setattr(decay_view, "panel_of", lambda area, region: panel)
    monkeypatch.setattr(drawing, "pixels", lambda points: points)  # without a window the interface has no size
    layout = decay_chart.layout_of(decay, panel)
    assert panel.left < layout.left < layout.left + layout.width < panel.right
    assert panel.bottom < layout.bottom < layout.bottom + layout.height < panel.top
    for frame in (5, 1):
        decay_view.go_to(context, layout.x_of(frame) + 1.0)
        assert scene.frame_current == frame
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert decay_view.shown() is None


def test_words_take_more_lines_where_there_is_less_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drawing, "text_size", lambda text, size=11.0: (10.0 * len(text), size))
    assert decay_chart.wrapped("one two three", 1000.0, 10.0) == ["one two three"]
    assert decay_chart.wrapped("one two three", 75.0, 10.0) == ["one two", "three"]
    assert decay_chart.wrapped("unbreakable one", 20.0, 10.0) == ["unbreakable", "one"]
    keys = [decay_chart.Key(name, 40.0) for name in "abc"]
    assert [len(line) for line in decay_chart.in_lines(keys, 120.0)] == [3]
    assert [len(line) for line in decay_chart.in_lines(keys, 100.0)] == [2, 1]
    assert [len(line) for line in decay_chart.in_lines(keys, 10.0)] == [1, 1, 1]
