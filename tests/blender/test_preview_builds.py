"""Previews whose trees take long: Blender stays responsive, Esc ends them, and viewports can share the trees."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from threading import Semaphore
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh  # noqa: E402
import perfect_bvh_addon  # noqa: E402
from blender.clouds import add_cloud  # noqa: E402
from blender.long_builds import (  # noqa: E402
    ESCAPE,
    MOUSE,
    PATIENCE,
    TIMER,
    FakeOperator,
    FakeWindow,
    Gate,
    building_threads,
    patiently,
    tick_until_half,
)
from perfect_bvh_addon.image.progressive import Pace  # noqa: E402
from perfect_bvh_addon.image.refinement import Refinement  # noqa: E402
from perfect_bvh_addon.live.scene_sync import SceneSync  # noqa: E402
from perfect_bvh_addon.live.sync_cache import sync_of  # noqa: E402
from perfect_bvh_addon.operators import preview  # noqa: E402
from perfect_bvh_addon.statistics import last_result  # noqa: E402

NAME = "Perfect BVH View"


@pytest.fixture(autouse=True)
def registered(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    perfect_bvh_addon.register()
    # There is no window: assume that an editor shows the image.
    monkeypatch.setattr(preview, "show_in_editor", lambda context, image: None)
    monkeypatch.setattr(preview.PERFECT_BVH_OT_preview, "_tell_where", lambda operator, context, what: None)
    yield
    perfect_bvh_addon.unregister()
    assert not building_threads()


def pixels() -> np.ndarray:
    image = bpy.data.images[NAME]
    values = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(values)
    return values


def undisturbed() -> np.ndarray:
    """Render the same scene without windows and with new trees."""
    perfect_bvh_addon.unregister()
    perfect_bvh_addon.register()
    assert bpy.ops.perfect_bvh.preview() == {"FINISHED"}
    made = pixels()
    bpy.data.images.remove(bpy.data.images[NAME])
    return made


def press() -> tuple[FakeOperator, FakeWindow]:
    operator, window = FakeOperator(preview.PERFECT_BVH_OT_preview), FakeWindow()
    assert operator.invoke(window, MOUSE) == {"RUNNING_MODAL"}
    return operator, window


def tick_to_the_end(operator: FakeOperator, window: FakeWindow) -> None:
    for _ in patiently("the preview does not end"):
        answer = operator.modal(window, TIMER)
        if answer != {"RUNNING_MODAL"}:
            assert (answer, operator.reports) == ({"FINISHED"}, [])
            assert (window.status, window.timers) == (None, 0)
            return


def session() -> SceneSync:
    return sync_of(bpy.context.evaluated_depsgraph_get())


def edit(cube: bpy.types.Object) -> None:
    cube.location.x = 1.0
    bpy.context.view_layer.update()


def test_it_builds_and_refines_while_blender_goes_on(gate: Gate, cube) -> None:
    operator, window = press()
    tick_until_half(operator, window)
    assert operator.modal(window, MOUSE) == {"PASS_THROUGH"}
    assert NAME not in bpy.data.images
    gate.open()
    tick_to_the_end(operator, window)
    assert window.progress == sorted(window.progress) and window.progress[-1] == 100.0
    np.testing.assert_array_equal(pixels(), undisturbed())


def test_escape_before_there_is_an_image_says_so(gate: Gate, cube) -> None:
    operator, window = press()
    tick_until_half(operator, window)
    assert operator.modal(window, ESCAPE) == {"CANCELLED"}
    assert operator.reports == [("INFO", "Canceled before the first sample")]
    assert (window.status, window.timers, building_threads()) == (None, 0, 0)
    assert NAME not in bpy.data.images
    gate.open()
    operator, window = press()
    tick_to_the_end(operator, window)
    np.testing.assert_array_equal(pixels(), undisturbed())


def test_escape_while_it_is_refined_keeps_what_there_is(cube, scene) -> None:
    scene.perfect_bvh.samples, scene.perfect_bvh.use_noise_threshold = 65536, False
    operator, window = press()
    while NAME not in bpy.data.images or operator._refinement.sample_count < 2:
        assert operator.modal(window, TIMER) == {"RUNNING_MODAL"}
    assert operator.modal(window, ESCAPE) == {"CANCELLED"}
    count = operator._refinement.sample_count
    assert operator.reports == [("INFO", f"Canceled after {count} samples")]
    assert pixels().any()


def test_the_timer_alone_advances_the_samples_and_the_time_that_remains(
    cube, scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The status is that of F12, and grows within a round of samples; no tick waits for a step of the image."""
    scene.perfect_bvh.samples, scene.perfect_bvh.use_noise_threshold = 16, False
    scene.render.resolution_y = 512
    clock = itertools.count(0.0, 0.5)
    monkeypatch.setattr(preview, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    monkeypatch.setattr(Pace, "pixel_samples_in", lambda pace, seconds: 32 * 64)  # two tiles of rows
    step, turn, done = Refinement.step, Semaphore(0), Semaphore(0)

    def step_in_turn(refinement: Refinement, *how: object) -> bool:
        assert turn.acquire(timeout=PATIENCE)
        better = step(refinement, *how)
        done.release()
        return better

    monkeypatch.setattr(Refinement, "step", step_in_turn)
    operator, window = press()
    states: list[str] = []
    while operator.modal(window, TIMER) == {"RUNNING_MODAL"}:
        states.append(window.status)
        if operator._refinement is not None and not operator._refinement.is_finished:
            turn.release()
            assert done.acquire(timeout=PATIENCE)
    rendered = [state for state in states if not state.startswith("Building")]
    form = r"Sample (\d+)/16 \| Time: \d\d:\d\d\.\d0( \| Remaining: \d\d:\d\d\.\d\d)? \| Esc: Cancel"
    found = [re.fullmatch(form, state) for state in rendered]
    counts = [int(each[1]) for each in found]
    assert counts == sorted(counts) and set(counts) > {3, 5, 6, 7, 9, 15}  # rounds end with 1, 2, 4, 8 and 16
    assert not found[0][2] and all(each[2] for each, count in zip(found, counts, strict=True) if count > 2)


def test_closing_the_window_of_the_image_stops_it(cube, scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Esc over that window closes it, and no other handler gets the event."""
    scene.perfect_bvh.samples, scene.perfect_bvh.use_noise_threshold = 65536, False
    operator, window = press()
    main, opened = (SimpleNamespace(screen=SimpleNamespace(areas=()), as_pointer=lambda at=at: at) for at in (1, 2))
    windows = window.window_manager.windows = [main]
    monkeypatch.setattr(preview, "show_in_editor", lambda context, image: windows.append(opened))
    while NAME not in bpy.data.images:
        assert operator.modal(window, TIMER) == {"RUNNING_MODAL"}
    assert operator.modal(window, TIMER) == {"RUNNING_MODAL"}
    windows.remove(opened)
    assert operator.modal(window, TIMER) == {"CANCELLED"}
    assert operator.reports == [("INFO", f"Canceled after {operator._refinement.sample_count} samples")]
    assert (window.status, window.timers) == (None, 0)


def test_it_shows_what_was_read_whatever_is_edited_meanwhile(gate: Gate, cube) -> None:
    expected = undisturbed_behind(gate)
    operator, window = press()
    tick_until_half(operator, window)
    edit(cube)
    gate.open()
    tick_to_the_end(operator, window)
    np.testing.assert_array_equal(pixels(), expected)


def undisturbed_behind(gate: Gate) -> np.ndarray:
    gate.open()
    made = undisturbed()
    perfect_bvh_addon.unregister()
    perfect_bvh_addon.register()
    gate.close()
    return made


def test_the_panels_tell_of_it(cube, scene) -> None:
    scene.frame_set(7)
    operator, window = press()
    tick_to_the_end(operator, window)
    statistics = last_result.last_statistics(scene)
    assert (statistics.source, statistics.frame, statistics.size) == (
        "View to Image",
        7.0,
        operator._refinement.view.plan.size,
    )
    assert not last_result.is_outdated(scene)


def edit_while_it_refines(cube, scene) -> tuple[FakeOperator, FakeWindow]:
    scene.perfect_bvh.samples, scene.perfect_bvh.use_noise_threshold = 64, False
    operator, window = press()
    for _ in patiently("there is no image"):
        operator.modal(window, TIMER)
        if operator._refinement is not None:
            break
    edit(cube)
    return operator, window


def test_the_panels_tell_that_the_scene_was_edited_meanwhile(cube, scene) -> None:
    operator, window = edit_while_it_refines(cube, scene)
    tick_to_the_end(operator, window)
    assert last_result.last_statistics(scene).source == "View to Image"
    assert last_result.is_outdated(scene)


def test_the_panels_tell_nothing_of_trees_that_are_others_in_the_end(cube, scene) -> None:
    operator, window = edit_while_it_refines(cube, scene)
    session().update(bpy.context.evaluated_depsgraph_get())
    tick_to_the_end(operator, window)
    assert last_result.last_statistics(scene) is None


@pytest.mark.parametrize("when", ["while it builds", "when it has built"])
def test_a_viewport_that_has_other_trees_built_is_waited_for(gate: Gate, cube, when: str) -> None:
    operator, window = press()
    tick_until_half(operator, window)
    mine = session().building
    if when == "when it has built":
        gate.open()
        assert mine.wait(PATIENCE)
        gate.close()
    edit(cube)
    viewports = session().begin_update(bpy.context.evaluated_depsgraph_get())
    assert viewports is not mine
    for _ in range(5):
        assert operator.modal(window, TIMER) == {"RUNNING_MODAL"}
    assert session().building is viewports, "the preview has stopped the viewport's trees"
    gate.open()
    tick_to_the_end(operator, window)
    np.testing.assert_array_equal(pixels(), undisturbed())


def test_two_previews_share_their_trees(gate: Gate, cube) -> None:
    first, second = press(), press()
    gate.wait_until_held()
    assert gate.held == building_threads() == 1
    for operator, window in (first, second):
        tick_until_half(operator, window)
    gate.open()
    for operator, window in (first, second):
        tick_to_the_end(operator, window)
    np.testing.assert_array_equal(pixels(), undisturbed())


def test_what_one_gives_up_another_restarts(gate: Gate, cube) -> None:
    (first, first_window), (second, second_window) = press(), press()
    tick_until_half(second, second_window)
    assert first.modal(first_window, ESCAPE) == {"CANCELLED"}
    assert second.modal(second_window, TIMER) == {"RUNNING_MODAL"}
    tick_until_half(second, second_window)
    gate.open()
    tick_to_the_end(second, second_window)
    np.testing.assert_array_equal(pixels(), undisturbed())


def test_another_file_or_scene_ends_it_with_a_reason(gate: Gate, cube) -> None:
    operator, window = press()
    tick_until_half(operator, window)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert not building_threads()
    assert operator.modal(window, TIMER) == {"CANCELLED"}
    assert operator.reports == [("ERROR", "The scene is no longer shown in a window")]
    assert (window.status, window.timers) == (None, 0)


def test_blender_ends_or_opens_a_file(gate: Gate, cube) -> None:
    operator, window = press()
    tick_until_half(operator, window)
    operator.cancel(window)
    assert (window.status, window.timers, building_threads()) == (None, 0, 0)


def test_what_fails_in_a_build_is_reported(cube, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(self: object, *_: object, **__: object) -> None:
        raise MemoryError("no room for trees")

    monkeypatch.setattr(perfect_bvh.Scene, "commit", fail)
    operator, window = press()
    while (answer := operator.modal(window, TIMER)) == {"RUNNING_MODAL"}:
        pass
    assert (answer, operator.reports) == ({"CANCELLED"}, [("ERROR", "No room for trees")])
    assert (window.status, window.timers) == (None, 0)


@pytest.mark.usefixtures("one_thread")
def test_a_large_mesh_is_given_up_and_shown_the_next_time(scene, cube, monkeypatch: pytest.MonkeyPatch) -> None:
    gate = Gate(monkeypatch, inside=True)
    add_cloud(1_000_000).location.z = -12.0
    operator, window = press()
    gate.wait_until_held()
    assert operator.modal(window, TIMER) == {"RUNNING_MODAL"}
    assert window.status.startswith("Building BVHs")
    assert operator.modal(window, ESCAPE) == {"CANCELLED"}
    assert not building_threads()
    gate.open()
    operator, window = press()
    tick_to_the_end(operator, window)
    np.testing.assert_array_equal(pixels(), undisturbed())
