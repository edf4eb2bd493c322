"""A thread that refines images: it runs to the end by itself, ends once stopped, and never runs twice at once."""

from __future__ import annotations

import gc
import threading
import weakref
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import perfect_bvh
import pytest
from blender.clay_sphere import view_of_a_sphere
from blender.long_builds import PATIENCE, wait_until
from perfect_bvh_addon.image.progressive import Pace
from perfect_bvh_addon.image.refinement import Refinement, Tracer, View
from perfect_bvh_addon.support import background_work

SIZE = (96, 128)


@pytest.fixture(scope="module")
def view() -> View:
    return view_of_a_sphere(SIZE, 4)


class Gate:
    """Holds calls of the renderer before they start. calls: their number. at_once: the most that ran at the same time.

    closes_at: the call before which it closes by itself; 0 for none.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.is_open = threading.Event()
        self.is_open.set()
        self.calls = self.under_way = self.at_once = self.closes_at = 0
        render = perfect_bvh.render_passes

        def hold(*arguments: Any, **options: Any) -> Any:
            self.calls += 1
            if self.calls == self.closes_at:
                self.is_open.clear()
            self.under_way += 1
            self.at_once = max(self.at_once, self.under_way)
            stop = options["progress"]
            try:
                while not self.is_open.wait(0.001) and not stop.is_set:
                    pass
                return render(*arguments, **options)
            finally:
                self.under_way -= 1

        monkeypatch.setattr(perfect_bvh, "render_passes", hold)


@pytest.fixture
def gate(monkeypatch: pytest.MonkeyPatch) -> Iterator[Gate]:
    yield Gate(monkeypatch)
    wait_until(lambda: not background_work._running)


def slow() -> Pace:
    """A pace so slow that an image takes many steps."""
    return Pace(seconds_per_pixel=1e-3)


def test_it_goes_on_to_the_end_by_itself_and_ends(view: View, gate: Gate) -> None:
    *_, (count, passes) = perfect_bvh.render_progressively(
        view.snapshot, view.camera, mode="clay", size=SIZE, samples=view.plan.samples
    )
    tracer, refinement = Tracer(), Refinement(view, slow())
    tracer.trace(refinement)
    wait_until(lambda: not tracer.is_running)
    assert refinement.is_finished and tracer.problem is None
    assert refinement.sample_count == count
    assert set(refinement.costs) == {"instance", "nodes_visited", "primitives_tested"}
    np.testing.assert_array_equal(refinement.image, passes["combined"])
    calls = gate.calls
    assert calls > 4
    tracer.trace(refinement)
    wait_until(lambda: not tracer.is_running)
    assert gate.calls == calls, "a finished image was traced again"


def test_a_stop_reaches_the_call_that_is_under_way_and_no_other_follows(view: View, gate: Gate) -> None:
    tracer, refinement = Tracer(), Refinement(view, slow())
    gate.closes_at = 2
    tracer.trace(refinement)
    wait_until(lambda: gate.under_way and gate.calls == 2)
    calls = gate.calls
    number = refinement.canvas.number
    tracer.stop()
    assert not tracer.is_running
    wait_until(lambda: not background_work._running)
    assert gate.calls == calls and refinement.canvas.number == number
    assert tracer.problem is None
    gate.is_open.set()
    tracer.trace(refinement)
    wait_until(lambda: refinement.is_finished)


def test_another_image_takes_its_place(view: View, gate: Gate) -> None:
    tracer = Tracer()
    gate.is_open.clear()
    images = [Refinement(view, slow()) for _ in range(6)]
    for refinement in images:
        tracer.trace(refinement)
    wait_until(lambda: not any(image.canvas.has_image.is_set() for image in images[:-1]) and gate.under_way == 1)
    gate.is_open.set()
    wait_until(lambda: images[-1].is_finished)
    assert gate.at_once == 1, "two images were traced at once"
    assert [image.is_finished for image in images] == [False] * 5 + [True]


def test_what_fails_is_handed_on_and_not_tried_again(view: View, gate: Gate, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any, **__: Any) -> None:
        gate.calls += 1
        raise ZeroDivisionError("no such thing")

    monkeypatch.setattr(perfect_bvh, "render_passes", fail)
    tracer, refinement = Tracer(), Refinement(view, slow())
    tracer.trace(refinement)
    tracer.wait_for_image()
    wait_until(lambda: not tracer.is_running)
    assert isinstance(tracer.problem, ZeroDivisionError)
    tracer.trace(refinement)
    assert not tracer.is_running and gate.calls == 1


def test_no_image_is_kept_longer_than_it_is_wanted(view: View, gate: Gate) -> None:
    tracer = Tracer()
    old = []
    for _ in range(3):
        refinement = Refinement(view, slow())
        tracer.trace(refinement)
        tracer.wait_for_image(PATIENCE)
        old.append(weakref.ref(refinement))
        del refinement
    tracer.stop()
    wait_until(lambda: not background_work._running)
    gc.collect()
    assert [made() is None for made in old] == [True, True, False]
    del tracer
    gc.collect()
    assert old[-1]() is None


def test_a_border_without_pixels_ends_with_an_empty_image(view: View, gate: Gate) -> None:
    nothing = replace(view, camera=replace(view.camera, border=(0.5, 0.5, 0.5, 0.5)))
    tracer, refinement = Tracer(), Refinement(nothing, slow())
    tracer.trace(refinement)
    wait_until(lambda: not tracer.is_running)
    assert refinement.is_finished and tracer.problem is None
    assert not refinement.image.any()
