"""Rendered viewports trace on separate threads: redraws never wait; edits, and the viewport's end, stop a trace."""

from __future__ import annotations

import gc
import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.long_builds import Gate, building_threads, wait_until  # noqa: E402
from blender.shown_viewport import Shown, cube_to_show, fresh, move  # noqa: E402
from perfect_bvh_addon.image.refinement import Refinement  # noqa: E402
from perfect_bvh_addon.view3d.rendered import viewport  # noqa: E402

pytestmark = pytest.mark.usefixtures("without_windows")


@pytest.fixture
def gate(gate: Gate) -> Gate:
    gate.open()
    return gate


@pytest.fixture
def cube(scene: bpy.types.Scene) -> bpy.types.Object:
    return cube_to_show(scene)


class TracingGate:
    """Holds all tracing, from the first image of a view on, until it is opened or stopped."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.is_open = threading.Event()
        step = Refinement.step

        def hold(refinement: Refinement, seconds: float, stop: Any = None) -> bool:
            while refinement.canvas.has_image.is_set() and not self.is_open.wait(0.002) and not stop.is_set:
                pass
            return step(refinement, seconds, stop)

        monkeypatch.setattr(Refinement, "step", hold)


def is_tracing() -> bool:
    return building_threads() > 0


def wait_for_the_end_of_tracing() -> None:
    wait_until(lambda: not is_tracing(), "something is still traced")


def test_a_redraw_traces_nothing_and_awaits_only_the_first_image(cube, gate: Gate, monkeypatch) -> None:
    tracing = TracingGate(monkeypatch)
    shown = Shown()
    shown.update()
    for _ in range(3):
        assert shown.redraw(), "there is more to come"
    assert shown.viewport.state.startswith("Sample ")
    refinement = shown.viewport._refinement
    assert np.isfinite(shown.screen[-1]).all(), "the coarse image is not shown"
    assert not shown.viewport.has_news
    tracing.is_open.set()
    wait_until(lambda: refinement.is_finished, "nothing is traced without redraws")
    assert shown.viewport.has_news
    np.testing.assert_array_equal(shown.finish(), fresh())
    assert not shown.viewport.is_working


def test_views_that_follow_each_other_are_refined_once_they_rest(cube, gate: Gate, monkeypatch) -> None:
    """The first image of each is shown at once; the next one is expected after a pause like the last."""
    now = [0.0]
    monkeypatch.setattr(viewport, "BURST_SECONDS", 10.0)
    monkeypatch.setattr(viewport, "time", SimpleNamespace(perf_counter=lambda: now[0]))
    bpy.context.scene.perfect_bvh.use_viewport_denoising = False  # which would be news
    TracingGate(monkeypatch)
    shown = Shown()
    shown.redraw()
    assert is_tracing(), "the first view is not one of many"
    for now[0] in (100.0, 104.0):
        move(cube, now[0])
        shown.update()
        assert shown.redraw() and np.isfinite(shown.screen[-1]).all()
        assert shown.viewport._tracer.is_running == (now[0] == 100.0)
    wait_for_the_end_of_tracing()
    now[0] = 109.9
    assert not shown.viewport.has_news, "it goes on while the next change is expected"
    now[0] = 110.1
    assert shown.viewport.has_news


@pytest.mark.parametrize("is_playing", [True, False])
def test_frames_that_play_are_traced_no_further_than_shown(cube, gate: Gate, monkeypatch, is_playing: bool) -> None:
    TracingGate(monkeypatch)
    shown = Shown()
    shown.context.screen.is_animation_playing = is_playing
    for x in (1.0, 2.0):
        move(cube, x)
        shown.update()
        shown.redraw()
        assert shown.viewport._tracer.is_running != is_playing
    shown.viewport.stop()
    wait_for_the_end_of_tracing()


def test_an_edit_stops_what_is_traced_before_it_is_read(cube, gate: Gate, monkeypatch) -> None:
    tracing = TracingGate(monkeypatch)
    shown = Shown()
    shown.update()
    shown.redraw()
    assert is_tracing()
    begin_view, tracing_at_reading = viewport.begin_view, []

    def begin(*arguments: Any) -> Any:
        tracing_at_reading.append(shown.viewport._tracer.is_running)
        return begin_view(*arguments)

    monkeypatch.setattr(viewport, "begin_view", begin)
    move(cube, 1.0)
    shown.update()
    assert tracing_at_reading == [False]
    tracing.is_open.set()
    np.testing.assert_array_equal(shown.finish(), fresh())


def test_what_was_traced_before_an_update_that_changes_nothing_stays(cube, gate: Gate, monkeypatch) -> None:
    tracing = TracingGate(monkeypatch)
    shown = Shown()
    shown.update()
    shown.redraw()
    refinement = shown.viewport._refinement
    shown.update()
    wait_for_the_end_of_tracing()
    assert shown.redraw()
    assert shown.viewport._refinement is refinement and is_tracing()
    tracing.is_open.set()
    np.testing.assert_array_equal(shown.finish(), fresh())


def test_a_viewport_that_goes_takes_its_thread_with_it(cube, gate: Gate, monkeypatch) -> None:
    TracingGate(monkeypatch)
    shown = Shown()
    shown.update()
    shown.redraw()
    assert is_tracing()
    del shown
    gc.collect()
    wait_for_the_end_of_tracing()


@pytest.mark.parametrize("what", ["unregister", "undo", "file"])
def test_tracing_ends_with_what_it_shows(cube, gate: Gate, monkeypatch, what: str) -> None:
    TracingGate(monkeypatch)
    shown = Shown()
    shown.update()
    shown.redraw()
    assert is_tracing()
    if what == "unregister":
        perfect_bvh_addon.unregister()
    elif what == "undo":
        bpy.app.handlers.undo_pre[0](bpy.context.scene, None)
    else:
        bpy.app.handlers.load_pre[0]("", None)
    wait_for_the_end_of_tracing()


@pytest.mark.parametrize("problem", [MemoryError("no room for an image"), ZeroDivisionError("never seen")])
def test_what_fails_while_it_is_traced_is_told(cube, gate: Gate, monkeypatch, capsys, problem: Exception) -> None:
    step = Refinement.step

    def fail(*_: object) -> bool:
        raise problem

    monkeypatch.setattr(Refinement, "step", fail)
    shown = Shown()
    shown.update()
    wait_until(lambda: not shown.redraw(), "the failure is not told")
    for _ in range(2):  # the traceback is printed once, however often it is asked for
        assert shown.viewport.state == str(problem)
    assert capsys.readouterr().err.count("ZeroDivisionError: never seen") == isinstance(problem, ZeroDivisionError)
    monkeypatch.setattr(Refinement, "step", step)
    move(cube, 1.0)
    shown.update()
    np.testing.assert_array_equal(shown.finish(), fresh())
