"""A viewport's image, refined step by step: in the end it equals a render, and the work on the way is bounded."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import perfect_bvh
import pytest
from blender.clay_sphere import view_of_a_sphere
from perfect_bvh_addon.image.denoising import Denoised, ImageDenoiser
from perfect_bvh_addon.image.plan import GUIDES
from perfect_bvh_addon.image.progressive import Pace, Step
from perfect_bvh_addon.image.refinement import COARSEST_DENOISED, SHORTEST_SECONDS, Refinement, View

SIZE = (97, 61)


@pytest.fixture(scope="module")
def view() -> View:
    return view_of_a_sphere(SIZE, 7)


def finish(refinement: Refinement, seconds: float) -> int:
    """Refine to the end; return the number of steps."""
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


@pytest.mark.parametrize("border", [(0.0, 1.0, 0.0, 1.0), (0.2, 0.71, 0.33, 0.9)])
def test_coarse_pixels_stand_for_exactly_so_many(view: View, border: tuple[float, ...]) -> None:
    """A coarse pixel shows the middle one of an odd number of pixels, so that parts of an image fit together."""
    camera = replace(view.camera, border=border)
    plan = replace(view.plan, settings=replace(view.plan.settings, mode="normal", samples=1))
    full = perfect_bvh.render(view.snapshot, camera, "normal", (96, 63))
    refinement = Refinement(replace(view, camera=camera, plan=replace(plan, size=(96, 63))), Pace())
    left, top, bottom = round(border[0] * 96), 63 - int(border[3] * 63), 63 - int(border[2] * 63)
    for divisor in (3, 9):
        step = Step(divisor, (top // 9 * 9, bottom))
        coarse = refinement._trace(step, None)["combined"]
        assert coarse.shape == (63 // divisor, -(-96 // divisor), 4)
        expected = full[divisor // 2 :: divisor, divisor // 2 :: divisor]
        inside = (slice(top // divisor + 1, bottom // divisor - 1), slice(left // divisor + 1, None))
        seen = coarse[: expected.shape[0], : expected.shape[1]][inside][..., 3] > 0
        np.testing.assert_allclose(
            np.where(seen[..., None], coarse[: expected.shape[0], : expected.shape[1]][inside], 0.0),
            expected[inside],
            atol=1e-3,
        )


def test_what_it_shows_is_coarse_first_and_then_grows_from_the_top(view: View) -> None:
    large = replace(view, plan=replace(view.plan, size=(256, 256)))
    refinement = Refinement(large, Pace(seconds_per_pixel=1e-3))
    assert refinement.canvas.patches({}) == []
    seen = []
    while refinement.sample_count == 0:
        refinement._pace.seconds_per_pixel = 1e-5
        refinement.step(0.01)
        seen.append([(patch.place.divisor, patch.place.rows) for patch in refinement.canvas.patches({})])
    assert seen[0] == [(16, (0, 256))]
    assert {divisor for shown in seen for divisor, _ in shown} >= {1, 2, 4, 16}
    finest = [sum(256 // divisor * (end - first) for divisor, (first, end) in shown) for shown in seen]
    assert finest == sorted(finest)
    assert seen[-1] == [(1, (0, 128)), (1, (128, 256))]


def test_a_reader_gets_only_what_has_changed(view: View) -> None:
    large = replace(view, plan=replace(view.plan, size=(64, 256)))
    refinement = Refinement(large, Pace(seconds_per_pixel=1e-9))
    refinement.step(1.0)
    patches = refinement.canvas.patches({})
    held = {patch.place: patch.number for patch in patches}
    assert [patch.pixels.shape for patch in patches] == [(128, 64, 4)] * 2
    assert all(patch.pixels is None for patch in refinement.canvas.patches(held))
    refinement._pace.seconds_per_pixel = 1.0
    refinement.step(0.0)  # the cost of the camera's rays
    refinement.step(0.0)  # a band of the second sample
    assert [patch.pixels is None for patch in refinement.canvas.patches(held)] == [False, True]


def test_a_stopped_step_is_lost_and_the_next_are_shorter(view: View) -> None:
    refinement = Refinement(view, Pace(seconds_per_pixel=1e-9))
    stop = perfect_bvh.make_stop_flag()
    stop.set()
    for _ in range(3):
        with pytest.raises(perfect_bvh.Cancelled):
            refinement.step(1.0, stop)
        assert refinement.image is None
    assert refinement._longest == SHORTEST_SECONDS
    finish(refinement, 1.0)
    expected = perfect_bvh.render(view.snapshot, view.camera, "clay", SIZE, 1)
    assert refinement.image.shape == expected.shape


def test_it_is_denoised_whenever_samples_double_and_at_the_end(view: View, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = replace(view.plan, settings=replace(view.plan.settings, denoise=True))
    counts: list[int] = []
    denoise = ImageDenoiser.denoise

    def note(denoiser: ImageDenoiser, images: Any, noise: Any, progress: Any = None) -> Any:
        counts.append(refinement.sample_count)
        return denoise(denoiser, images, noise, progress)

    monkeypatch.setattr(ImageDenoiser, "denoise", note)
    refinement = Refinement(replace(view, plan=plan), Pace())
    while not counts:
        assert not refinement.canvas.is_replaced
        refinement.step(1e-4)
    assert refinement.canvas.is_replaced
    finish(refinement, 1e-4)
    assert counts == [1, 2, 4, 7]
    noise: dict[str, Any] = {}
    *_, (_, passes) = perfect_bvh.render_progressively(
        view.snapshot,
        view.camera,
        mode="clay",
        size=SIZE,
        samples=7,
        passes=("combined", *GUIDES),
        noise=noise,
        **plan.options,
    )
    np.testing.assert_array_equal(refinement.canvas.film, passes["combined"])
    expected = denoise(ImageDenoiser(plan), passes, noise)
    assert expected.name is not None and refinement.complaint == expected.complaint
    np.testing.assert_array_equal(refinement.image, expected.image)
    shown = refinement.canvas.patches({})
    np.testing.assert_array_equal(np.concatenate([patch.pixels for patch in shown]), expected.image)


def trace_coarse(view: View) -> dict[int, list[Any]]:
    """Trace a denoised view; return its coarse images in the order of their arrival, by divisor."""
    plan = replace(view.plan, size=(256, 256), settings=replace(view.plan.settings, denoise=True))
    refinement = Refinement(replace(view, plan=plan), Pace(seconds_per_pixel=1e-3))
    found: dict[int, list[Any]] = {}
    put = refinement.canvas.put_coarse
    refinement.canvas.put_coarse = lambda image, divisor, rows, is_whole: (  # type: ignore[method-assign]
        found.setdefault(divisor, []).append((rows, image)),
        put(image, divisor, rows, is_whole),
    )
    while refinement.sample_count == 0:
        refinement._pace.seconds_per_pixel = 1e-5
        refinement.step(0.01)
    return found


def test_coarse_images_are_denoised_but_for_the_coarsest(view: View, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their rows come in parts: each part is shown at once, and again after denoising."""
    found = trace_coarse(view)
    assert max(found) > COARSEST_DENOISED >= min(found) > 1
    for divisor, shown in found.items():
        rows = [rows for rows, _ in shown]
        if divisor > COARSEST_DENOISED:
            assert len(set(rows)) == len(rows)
            continue
        assert rows[::2] == rows[1::2] == sorted(set(rows))
        for (first, end), raw, (_, made) in zip(
            rows[::2], [image for _, image in shown[::2]], shown[1::2], strict=True
        ):
            part = slice(first // divisor, -(-end // divisor))
            assert made.shape == raw.shape and np.isfinite(made).all()
            assert not np.array_equal(made[part], raw[part])
            np.testing.assert_allclose(made[part].mean(), raw[part].mean(), rtol=0.2)


def test_coarse_images_that_cannot_be_denoised_stay_as_they_are(view: View, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any, **__: Any) -> Any:
        raise MemoryError

    monkeypatch.setattr(perfect_bvh, "Denoiser", fail)
    for divisor, shown in trace_coarse(view).items():
        if divisor <= COARSEST_DENOISED:
            for (_, raw), (_, made) in zip(shown[::2], shown[1::2], strict=True):
                np.testing.assert_array_equal(made, raw)


def test_what_cannot_be_denoised_is_shown_as_it_is_and_says_why(view: View, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = replace(view.plan, settings=replace(view.plan.settings, denoise=True))
    made = lambda *_: Denoised(np.zeros(1), None, 0.0, "no room for it")  # noqa: E731
    monkeypatch.setattr(ImageDenoiser, "denoise", made)
    refinement, raw = Refinement(replace(view, plan=plan), Pace()), Refinement(view, Pace())
    for each in (refinement, raw):
        finish(each, 1.0)
    assert refinement.complaint == "no room for it" and not refinement.canvas.is_replaced
    np.testing.assert_array_equal(refinement.image, refinement.canvas.film)
    np.testing.assert_allclose(refinement.image.mean((0, 1)), raw.image.mean((0, 1)), rtol=0.01)


def test_nothing_is_done_to_a_finished_image(view: View) -> None:
    refinement = Refinement(view, Pace())
    finish(refinement, 1.0)
    before = refinement.image.copy()
    assert not refinement.step(1.0)
    np.testing.assert_array_equal(refinement.image, before)


@pytest.mark.parametrize("border", [(0.0, 1.0, 0.0, 1.0), (0.2, 0.71, 0.33, 0.9), (0.5, 0.5, 0.0, 1.0)])
@pytest.mark.parametrize("denoise", [False, True])
def test_samples_end_where_they_end_in_a_render(view: View, border: tuple[float, ...], denoise: bool) -> None:
    settings = replace(view.plan.settings, samples=128, noise_threshold=0.004, denoise=denoise)
    view = replace(view, camera=replace(view.camera, border=border), plan=replace(view.plan, settings=settings))
    sampling = perfect_bvh.AdaptiveSampling(SIZE, 0.004)
    rounds = perfect_bvh.render_progressively(
        view.snapshot,
        view.camera,
        size=SIZE,
        samples=128,
        passes=("combined", *(GUIDES if denoise else ())),
        sampling=sampling,
    )
    *_, (count, passes) = rounds
    refinement = Refinement(view, Pace())
    finish(refinement, 1e-4)
    assert refinement.sample_count == count and refinement.progress == 1.0
    assert refinement.mean_samples == sampling.mean_samples
    assert border[0] == border[1] or 16 <= sampling.mean_samples < count
    np.testing.assert_array_equal(refinement.canvas.film, passes["combined"])
    for name in GUIDES if denoise else ():
        np.testing.assert_array_equal(refinement._guides[name], passes[name])


def test_data_has_no_noise_that_could_end_its_samples(view: View) -> None:
    settings = replace(view.plan.settings, noise_threshold=1.0, samples=32)
    noisy = replace(view.plan, settings=settings)
    data = replace(view.plan, settings=replace(settings, mode="normal"))
    assert noisy.make_sampling() is not None and data.make_sampling() is None
    assert replace(view.plan, settings=replace(settings, noise_threshold=0.0)).make_sampling() is None
    counts = []
    for plan in (noisy, data):
        refinement = Refinement(replace(view, plan=plan), Pace())
        finish(refinement, 1.0)
        counts.append(refinement.sample_count)
    assert counts == [16, 32]


def test_what_the_cameras_rays_cost_is_there_with_the_first_full_image(view: View) -> None:
    refinement = Refinement(view, Pace(seconds_per_pixel=1e-3))
    while refinement.sample_count == 0:
        assert refinement.costs is None
        refinement.step(0.0)
    while refinement.costs is None:
        refinement.step(0.0)
    assert refinement.costs and refinement.sample_count < view.plan.samples
