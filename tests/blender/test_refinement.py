"""A viewport's image, refined step by step: the same as a render's in the end, and bounded work on the way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from perfect_bvh_addon.image.plan import plan_view
from perfect_bvh_addon.image.progressive import Pace, Refinement, View
from perfect_bvh_addon.settings.scene_settings import RenderSettings

SIZE = (97, 61)


@pytest.fixture(scope="module")
def view() -> View:
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*meshes.sphere(16, 24)))
    scene.commit()
    camera = perfect_bvh.Camera.look_at((3.0, 2.0, 1.5), (0.0, 0.0, 0.0), aspect=SIZE[0] / SIZE[1])
    settings = RenderSettings("clay", 7, ao_distance=0.0, use_material_colors=True, threads=0)
    return View(scene.snapshot(), perfect_bvh.Appearance(), camera, plan_view(settings, SIZE))


def finish(refinement: Refinement, seconds: float) -> int:
    """How many steps it takes."""
    steps = 0
    while not refinement.is_finished:
        refinement.step(seconds)
        steps += 1
        assert steps < 10_000
    return steps


@pytest.mark.parametrize("border", [(0.0, 1.0, 0.0, 1.0), (0.2, 0.71, 0.33, 0.9), (0.0, 0.5, 0.95, 1.0)])
@pytest.mark.parametrize("mode", ["clay", "normal"])
def test_it_ends_as_a_render_does(view: View, border: tuple[float, ...], mode: str) -> None:
    settings = replace(view.plan.settings, mode=mode)
    view = replace(view, camera=replace(view.camera, border=border), plan=replace(view.plan, settings=settings))
    rounds = perfect_bvh.render_progressively(
        view.snapshot, view.camera, mode=mode, size=SIZE, samples=view.plan.samples
    )
    *_, (count, passes) = rounds
    refinement = Refinement(view, Pace())
    assert finish(refinement, 1e-4) > 3
    assert refinement.sample_count == count == view.plan.samples
    np.testing.assert_array_equal(refinement.image, passes["combined"])


def test_the_first_step_always_makes_an_image(view: View) -> None:
    slow = Pace(seconds_per_pixel=1.0)
    refinement = Refinement(view, slow)
    assert refinement.step(0.01)
    assert refinement.image is not None and refinement.image.shape == (SIZE[1] // 8, SIZE[0] // 8, 4)
    assert refinement.sample_count == 0
    fast = Refinement(view, Pace(seconds_per_pixel=1e-12))
    assert fast.step(10.0)
    assert fast.image is not None and fast.image.shape == (SIZE[1], SIZE[0], 4)


def test_a_step_is_bounded_by_its_time(view: View) -> None:
    """The clock goes on by a second at each look: no step may look much longer than its time."""
    now = 0.0

    def clock() -> float:
        nonlocal now
        now += 1.0
        return now

    refinement = Refinement(view, Pace(), clock)
    refinement.step(2.0)
    while not refinement.is_finished:
        before = now
        refinement.step(2.0)
        assert now - before <= 8.0


def test_a_half_traced_first_image_does_not_show(view: View) -> None:
    refinement = Refinement(view, Pace(seconds_per_pixel=1.0))
    refinement.step(0.01)
    coarse = refinement.image
    while refinement.sample_count == 0:
        assert refinement.image is coarse
        refinement.step(0.0)
    assert refinement.image is not coarse


def test_nothing_is_done_to_a_finished_image(view: View) -> None:
    refinement = Refinement(view, Pace())
    finish(refinement, 1.0)
    before = refinement.image.copy()
    assert not refinement.step(1.0)
    np.testing.assert_array_equal(refinement.image, before)
