"""Walk a Ray without a screen: clicks, keys and buttons, the events that end a walk, and those that make it old."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

bpy: Any = pytest.importorskip("bpy")

from blender.clicked_viewport import Viewport  # noqa: E402
from blender.drawn_texts import RecordingLayout  # noqa: E402
from blender.long_builds import TIMER, FakeOperator, FakeWindow, Gate  # noqa: E402
from perfect_bvh_addon.operators import walk as operators  # noqa: E402
from perfect_bvh_addon.panels.viewports import WALK_WORDS, PERFECT_BVH_PT_walk_ray  # noqa: E402
from perfect_bvh_addon.statistics.messages import messages_of  # noqa: E402
from perfect_bvh_addon.view3d.walk import walk_view  # noqa: E402
from perfect_bvh_addon.view3d.walk import walk_view as walk_reading  # noqa: E402
from perfect_bvh_addon.view3d.walk.walk_picture import CHANGED  # noqa: E402

pytestmark = pytest.mark.usefixtures("scene", "registered")


@pytest.fixture
def viewport(box: Any) -> Any:
    """A viewport over a cube from -1 to 1."""
    found = Viewport()
    found.start()
    yield found
    walk_view.hide()


def test_a_click_walks_the_pixels_ray(viewport: Viewport) -> None:
    assert viewport.cursor == "CROSSHAIR" and "click a pixel" in viewport.context.status
    assert viewport.send("LEFTMOUSE", 270, 100) == {"PASS_THROUGH"}  # the panel's
    assert viewport.send("RIGHT_ARROW") == {"PASS_THROUGH"}
    assert walk_view.shown() is None
    viewport.click()
    walk = walk_view.shown()
    assert walk is not None and walk.steps[-1].sentence == "The nearest hit is Cube"
    layout, system = RecordingLayout(), SimpleNamespace(ui_scale=1.0)
    given = {"region": SimpleNamespace(width=280), "preferences": SimpleNamespace(system=system), "window": None}
    PERFECT_BVH_PT_walk_ray.draw(SimpleNamespace(layout=layout), SimpleNamespace(scene=bpy.context.scene, **given))
    assert WALK_WORDS in " ".join(layout.texts)
    assert viewport.cursor == "DEFAULT" and "Esc: end" in viewport.context.status
    assert walk.ray.at(walk.ray.end(-1))[2] == pytest.approx(1.0, abs=1e-5)  # t is a float, and the ray begins far away
    viewport.click(101, 51)  # next to the cube
    other = walk_view.shown()
    assert other is not None and other is not walk and other.steps[-1].sentence == "The ray hits nothing"
    assert viewport.send("ESC") == {"FINISHED"}
    assert walk_view.shown() is None and viewport.is_idle


def test_what_cannot_be_walked_is_said_until_the_next_click(
    viewport: Viewport, scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> Any:
        raise ValueError("the view has no usable matrix")

    with monkeypatch.context() as patch:
        patch.setattr(walk_reading, "read_pixel", fail)
        viewport.click()
    said = "The view has no usable matrix"
    assert viewport.operator.reports == [("WARNING", said)]
    assert [message.text for message in messages_of(scene) if message.source == "Walk a Ray"] == [said]
    assert viewport.cursor == "CROSSHAIR", "another pixel can be clicked"
    viewport.click()
    assert walk_view.shown() is not None
    assert not [message for message in messages_of(scene) if message.source == "Walk a Ray"]


def test_keys_and_buttons_step(viewport: Viewport) -> None:
    viewport.click()
    walk = walk_view.shown()
    assert walk is not None and walk.index == 0 and len(walk.steps) > 3
    for key, index in (("RIGHT_ARROW", 1), ("RIGHT_ARROW", 2), ("LEFT_ARROW", 1), ("HOME", 0), ("LEFT_ARROW", 0)):
        assert viewport.send(key) == {"RUNNING_MODAL"}
        assert walk.index == index
    assert viewport.send("RIGHT_ARROW", 20, 20) == {"PASS_THROUGH"}  # elsewhere keys are others'
    viewport.send("END")
    assert walk.index == len(walk.steps) - 1
    viewport.send("HOME")
    for key, part in (("RIGHT_ARROW", 0), ("RIGHT_ARROW", 1), ("LEFT_ARROW", 0)):
        assert viewport.send(key, shift=True) == {"RUNNING_MODAL"}
        assert (walk.index, walk.part) == (1, part)
    assert viewport.send("SPACE", shift=True) == {"PASS_THROUGH"}, "Blender's own"
    for to, place in (("NEXT_BOX", (1, 1)), ("PREVIOUS_BOX", (1, 0)), ("NEXT", (1, None))):
        assert bpy.ops.perfect_bvh.walk_step(to=to) == {"FINISHED"}
        assert (walk.index, walk.part) == place
    for to, index in (("FIRST", 0), ("NEXT", 1), ("LAST", len(walk.steps) - 1), ("PREVIOUS", len(walk.steps) - 2)):
        assert bpy.ops.perfect_bvh.walk_step(to=to) == {"FINISHED"}
        assert walk.index == index
    assert bpy.ops.perfect_bvh.walk_step(to="OFF") == {"FINISHED"}
    assert not bpy.ops.perfect_bvh.walk_step.poll()
    assert viewport.send("TIMER") == {"FINISHED"} and viewport.is_idle


def test_it_plays_to_the_end_and_pauses(viewport: Viewport) -> None:
    viewport.click()
    walk = walk_view.shown()
    assert walk is not None
    ticks = round(walk_view.PLAY_SECONDS / operators.TIMER_SECONDS)
    viewport.send("SPACE")
    for _ in range(ticks):
        assert viewport.operator.modal(viewport.context, TIMER) == {"PASS_THROUGH"}
    assert walk.index == 1 and walk.is_playing
    viewport.send("SPACE")
    for _ in range(ticks):
        viewport.operator.modal(viewport.context, TIMER)
    assert walk.index == 1 and not walk.is_playing
    viewport.send("SPACE")
    for _ in range(ticks * len(walk.steps)):
        viewport.operator.modal(viewport.context, TIMER)
    assert walk.index == len(walk.steps) - 1 and not walk.is_playing
    viewport.send("SPACE")
    assert walk.index == 0 and walk.is_playing  # from the beginning


def test_the_newest_alone_goes_on(viewport: Viewport) -> None:
    viewport.click()
    later = Viewport()
    later.start()
    assert walk_view.shown() is None
    assert viewport.send("TIMER") == {"CANCELLED"} and viewport.context.timers == 0
    later.click()
    assert walk_view.shown() is not None and later.context.status is not None
    assert later.send("ESC") == {"FINISHED"}


def test_it_ends_with_its_viewport_its_file_and_an_undo(viewport: Viewport) -> None:
    viewport.click()
    viewport.context.window.screen.areas.clear()
    assert viewport.send("TIMER") == {"FINISHED"} and viewport.is_idle and walk_view.shown() is None
    again = Viewport()
    again.start()
    again.click()
    walk_view._tool.on_change("an object was edited")
    assert walk_view.shown() is not None
    walk_view._tool.on_change("a step was undone")
    assert walk_view.shown() is None and again.send("TIMER") == {"FINISHED"}
    again.start()
    again.click()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert walk_view.shown() is None and not any(handler._handle for handler in walk_view._handlers)


def test_trees_are_waited_for_no_longer_where_their_viewport_is_closed(
    viewport: Viewport, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = SimpleNamespace(scene_uid=bpy.context.scene.session_uid)
    waits = {"state": "Building BVHs", "walk": lambda context: None, "stop": lambda: None}
    reading = SimpleNamespace(address=7, read=read, **waits)
    monkeypatch.setattr(walk_reading, "read_pixel", lambda *_: reading)
    assert viewport.send("LEFTMOUSE") == {"RUNNING_MODAL"}
    assert viewport.send("TIMER") == {"PASS_THROUGH"}
    viewport.context.window.screen.areas.clear()
    assert viewport.send("TIMER") == {"CANCELLED"} and viewport.is_idle


def test_a_walk_changes_nothing_and_knows_when_it_is_old(viewport: Viewport, scene: Any) -> None:
    before = sorted(block.name for block in (*bpy.data.objects, *bpy.data.meshes, *bpy.data.scenes))
    viewport.click()
    walk = walk_view.shown()
    assert walk is not None and not walk.is_old(scene)
    assert before == sorted(block.name for block in (*bpy.data.objects, *bpy.data.meshes, *bpy.data.scenes))
    bpy.data.objects["Cube"].location.z = 3.0
    bpy.context.view_layer.update()
    assert walk.is_old(scene)
    viewport.click()
    newer = walk_view.shown()
    assert newer is not None and not newer.is_old(scene)
    assert newer.ray.at(newer.ray.end(-1))[2] == pytest.approx(4.0)
    scene.frame_set(scene.frame_current + 1)
    assert newer.is_old(scene)


def test_nothing_is_shown_of_a_scene_that_has_changed(viewport: Viewport, scene: Any) -> None:
    viewport.click()
    walk = walk_view.shown()
    context = SimpleNamespace(scene=scene, space_data=viewport.area.spaces.active)
    assert walk is not None and walk_view.shown_in(context) is walk
    viewport.send("SPACE")
    bpy.data.objects["Cube"].location.z = 3.0
    bpy.context.view_layer.update()
    assert walk_view.shown_in(context) is None, "at once"
    assert viewport.operator.modal(viewport.context, TIMER) == {"PASS_THROUGH"}
    assert viewport.operator.reports == [("WARNING", CHANGED)] and not walk.is_playing
    assert [message.text for message in messages_of(scene) if message.source == "Walk a Ray"] == [CHANGED]
    assert viewport.cursor == "CROSSHAIR" and "click a pixel" in viewport.context.status
    index = walk.index
    assert viewport.send("RIGHT_ARROW") == {"PASS_THROUGH"} and walk.index == index
    bpy.data.objects["Cube"].location.z = 0.0
    bpy.context.view_layer.update()
    assert viewport.send("TIMER") == {"PASS_THROUGH"} and walk_view.shown_in(context) is None, "it stays old"
    assert len(viewport.operator.reports) == 1
    viewport.click()
    newer = walk_view.shown()
    assert newer is not walk and walk_view.shown_in(context) is newer and viewport.cursor == "DEFAULT"
    assert not [message for message in messages_of(scene) if message.source == "Walk a Ray"]


@pytest.mark.parametrize("change", ["an edit", "a frame", "a scene"])
def test_a_scene_that_changes_while_trees_are_built_is_noticed(
    viewport: Viewport, scene: Any, monkeypatch: pytest.MonkeyPatch, change: str
) -> None:
    gate = Gate(monkeypatch)
    try:
        assert viewport.send("LEFTMOUSE") == {"RUNNING_MODAL"}
        assert viewport.operator._reading is not None and "Building BVHs" in viewport.context.status
        assert viewport.send("TIMER") == {"PASS_THROUGH"} and not viewport.operator.reports
        if change == "an edit":
            bpy.data.objects["Cube"].location.z = 3.0
            bpy.context.view_layer.update()
        elif change == "a frame":
            scene.frame_set(scene.frame_current + 1)
        else:
            viewport.context._known["scene"] = SimpleNamespace(session_uid=-1)
            assert viewport.send("TIMER") == {"CANCELLED"} and viewport.is_idle
            return
        assert viewport.send("TIMER") == {"PASS_THROUGH"}
        assert viewport.operator.reports == [("WARNING", CHANGED)] and viewport.operator._reading is None
        assert viewport.cursor == "CROSSHAIR" and "click a pixel" in viewport.context.status
        assert walk_view.shown() is None
    finally:
        gate.open()
    viewport.click()
    assert walk_view.shown() is not None


def test_a_step_is_told_of_once_in_a_quad_view(viewport: Viewport) -> None:
    viewport.click()
    walk = walk_view.shown()
    assert walk is not None

    def told_in(space: int, views: tuple[int, ...], view: int) -> bool:
        pointers = [SimpleNamespace(as_pointer=lambda number=number: number) for number in views]
        area = SimpleNamespace(as_pointer=lambda: space, region_quadviews=pointers)
        context = SimpleNamespace(space_data=area, region_data=SimpleNamespace(as_pointer=lambda: view))
        return walk_view.tells(context, walk)

    assert told_in(7, (), 8) and not told_in(6, (), 8)
    assert [told_in(7, (1, 8, 2, 3), view) for view in (1, 8, 2, 3)] == [False, True, False, False]
    assert [told_in(7, (1, 2, 3, 4), view) for view in (1, 2, 3, 4)] == [False, False, False, True]


def test_scripts_are_told_that_it_needs_a_click(box: Any) -> None:
    assert not bpy.ops.perfect_bvh.walk_ray.poll()  # no window
    operator = FakeOperator(operators.PERFECT_BVH_OT_walk_ray)
    assert operator.execute(FakeWindow()) == {"CANCELLED"}
    assert "needs a click" in operator.reports[0][1]
