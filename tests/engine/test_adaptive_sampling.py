"""Samples end where there are enough: which tiles those are, and that nothing else about the image changes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import perfect_bvh
import pytest
from oracles import meshes
from perfect_bvh import AdaptiveSampling, Camera, Scene, render_passes, render_progressively

SIZE = (150, 70)  # no multiple of the tile size
TILES = (3, 5)
CAMERA = Camera.look_at((3.0, 2.0, 1.5), (0.0, 0.0, 0.0), aspect=150 / 70)
GUIDES = ("denoising_color", "denoising_albedo", "denoising_normal")


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A sphere, noisy by its light, before a smooth backdrop."""
    made = Scene()
    made.add_instance(made.add_mesh(*meshes.sphere(16, 24)))
    made.commit()
    return made


def finish(scene: Scene, threshold: float, samples: int = 128, **options: Any) -> tuple[Any, int, AdaptiveSampling]:
    """The passes in the end, the samples of the last round, and where they were ended."""
    sampling = AdaptiveSampling(SIZE, threshold, options.pop("min_samples", 0))
    arguments: dict[str, Any] = {"size": SIZE, "samples": samples, "sampling": sampling} | options
    *_, (done, passes) = render_progressively(scene, arguments.pop("camera", CAMERA), **arguments)
    return passes, done, sampling


def of_pixels(tiles: npt.NDArray[Any]) -> npt.NDArray[Any]:
    return tiles.repeat(32, axis=0)[: SIZE[1]].repeat(32, axis=1)[:, : SIZE[0]]


# Tiles ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["preview", "clay", "normal"])
@pytest.mark.parametrize("passes", [("combined",), ("combined", "depth"), ("combined", *GUIDES), ("depth", "instance")])
@pytest.mark.parametrize("samples", [1, 4])
def test_tiles_are_the_same_whichever_others_are_left_out(
    scene: Scene, mode: Any, passes: tuple[str, ...], samples: int
) -> None:
    """Bit for bit, though pixels share samples across tiles."""
    options: dict[str, Any] = {"mode": mode, "size": SIZE, "samples": samples, "passes": passes, "filter_width": 2.7}
    whole = render_passes(scene, CAMERA, **options)
    nothing = {"depth": 1e10, "instance": -1}
    random = np.random.default_rng(3)
    for tiles in (*(random.random((4, *TILES)) < 0.4), np.zeros(TILES, np.bool_)):
        part, pixels = render_passes(scene, CAMERA, tiles=tiles, **options), of_pixels(tiles)
        for name in passes:
            np.testing.assert_array_equal(part[name][pixels], whole[name][pixels])
            assert (part[name][~pixels] == nothing.get(name, 0)).all()


@pytest.mark.parametrize(
    ("tiles", "expected"),
    [(np.ones((3, 4), np.bool_), r"shape \(3, 5\), got bool of \(3, 4\)"), (np.ones(TILES), "got float64")],
)
def test_tiles_that_are_not_the_images_are_refused(scene: Scene, tiles: Any, expected: str) -> None:
    with pytest.raises(ValueError, match=f"render_passes: tiles must be bool of .*{expected}"):
        render_passes(scene, CAMERA, size=SIZE, tiles=tiles)


# Where samples end ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("passes", [("combined",), ("combined", *GUIDES)])
def test_a_threshold_that_nothing_reaches_changes_nothing(scene: Scene, passes: tuple[str, ...]) -> None:
    options: dict[str, Any] = {"size": SIZE, "samples": 40, "passes": passes}
    *_, (_, expected) = render_progressively(scene, CAMERA, **options)
    found, done, sampling = finish(scene, 1e-30, 40, passes=passes)
    for name in passes:
        np.testing.assert_array_equal(found[name], expected[name])
    assert done == 40 and sampling.mean_samples == 40 and (sampling.sample_counts == 40).all()


def test_finished_tiles_are_those_of_an_image_of_so_many_samples(scene: Scene) -> None:
    passes, done, sampling = finish(scene, 0.004)
    counts = of_pixels(sampling.sample_counts)
    assert set(np.unique(counts)) >= {16, 32}, "tiles should differ"
    assert done == counts.max()
    for count, expected in render_progressively(scene, CAMERA, size=SIZE, samples=128):
        there = counts == count
        np.testing.assert_array_equal(passes["combined"][there], expected["combined"][there])
    assert sampling.mean_samples == pytest.approx(counts.mean())
    assert sampling.ray_count == counts.sum()


@pytest.mark.parametrize("passes", [("combined",), ("combined", *GUIDES)])
def test_threads_change_nothing(scene: Scene, passes: tuple[str, ...]) -> None:
    first, *others = (finish(scene, 0.004, passes=passes, threads=threads) for threads in (1, 2, 3))
    for other in others:
        for name in passes:
            np.testing.assert_array_equal(first[0][name], other[0][name])
        np.testing.assert_array_equal(first[2].sample_counts, other[2].sample_counts)


def test_a_lower_threshold_takes_more_samples_and_leaves_less_noise(scene: Scene) -> None:
    exact = perfect_bvh.render(scene, CAMERA, size=SIZE, samples=512, seed=7)
    counts, errors = [], []
    for threshold in (0.02, 0.006, 0.003):
        passes, _, sampling = finish(scene, threshold)
        counts.append(sampling.mean_samples)
        errors.append(np.abs(passes["combined"] - exact)[..., :3].mean())
    assert counts == sorted(set(counts)) and errors == sorted(errors, reverse=True)


def test_tiles_outside_of_the_border_get_no_samples(scene: Scene) -> None:
    camera = replace(CAMERA, border=(0.5, 0.9, 0.0, 0.4))
    passes, done, sampling = finish(scene, 0.002, camera=camera)
    np.testing.assert_array_equal(sampling.sample_counts > 0, np.outer([0, 1, 1], [0, 0, 1, 1, 1]) > 0)
    inside = passes["combined"][..., 3] > 0
    counts = of_pixels(sampling.sample_counts)[inside]
    assert counts.sum() == sampling.ray_count and counts.mean() == pytest.approx(sampling.mean_samples)
    assert 16 <= sampling.mean_samples <= done


def test_as_many_samples_as_are_asked_for_at_least(scene: Scene) -> None:
    for least, expected in ((0, 16), (1, 2), (5, 8), (33, 64), (1000, 128)):
        _, done, sampling = finish(scene, 1e3, min_samples=least)
        assert done == expected == sampling.mean_samples


def test_a_time_limit_ends_samples_too(scene: Scene) -> None:
    one = perfect_bvh.render(scene, CAMERA, size=SIZE, is_continued=True)
    passes, done, sampling = finish(scene, 0.01, time_limit=1e-6)
    np.testing.assert_array_equal(passes["combined"], one)
    assert done == 1 == sampling.mean_samples


# Judging tiles ------------------------------------------------------------------------------------------------------


def judge(difference: npt.ArrayLike, brightness: float = 1.0, done: int = 64, count: int = 64) -> AdaptiveSampling:
    """Two images of one tile, which differ by this amount in the red of each pixel."""
    sampling = AdaptiveSampling((32, 32), 0.01)
    made = np.full((32, 32, 4), brightness, np.float32)
    before = made.copy()
    before[..., 0] += np.float32(0.5) * difference
    made[..., 0] -= np.float32(0.5) * difference
    sampling.note_round(before, made, done, count)
    return sampling


def test_a_spot_of_noise_is_not_lost_in_a_quiet_tile() -> None:
    spot = np.zeros((32, 32), np.float32)
    spot[9:11, 17:19] = 2.0  # of four pixels among 1024; 0.036 of the mean of its block
    assert not judge(spot).is_finished
    assert judge(spot / 8).is_finished


def test_noise_counts_as_it_is_seen() -> None:
    noise = np.full((32, 32), 0.02 * np.sqrt(3.0), np.float32)  # half of it is the mean's
    assert judge(0.99 * noise).is_finished and not judge(1.01 * noise).is_finished
    assert judge(1.98 * noise, 4.0).is_finished and not judge(2.02 * noise, 4.0).is_finished


def test_rounds_of_other_sizes_say_the_same() -> None:
    """Of noise whose variance goes with the samples: the images differ more, their mean is off by as much."""
    noise = 0.01 * np.sqrt(3.0 * (128 / 96 + 128 / 32)) * np.ones((32, 32), np.float32)
    assert judge(0.99 * noise, done=96, count=32).is_finished
    assert not judge(1.01 * noise, done=96, count=32).is_finished


def test_too_few_samples_say_nothing() -> None:
    assert not judge(np.zeros((32, 32)), done=0, count=64).is_finished
    assert not judge(np.zeros((32, 32)), done=8, count=4).is_finished
    assert not judge(np.zeros((32, 32)), done=64, count=15).is_finished
    assert judge(np.zeros((32, 32)), done=64, count=16).is_finished


def test_what_is_not_a_number_is_never_good_enough() -> None:
    for wrong in (np.nan, np.inf):
        difference = np.zeros((32, 32), np.float32)
        difference[3, 3] = wrong
        assert not judge(difference).is_finished


def test_pixels_with_nothing_in_them_do_not_thin_the_noise_of_others() -> None:
    """Hair before a transparent film, the rows and columns at a border."""
    sampling = AdaptiveSampling((32, 32), 0.01)
    before, made = (np.zeros((32, 32, 4), np.float32) for _ in range(2))
    before[20, 5], made[20, 5] = 1.0, 0.9
    sampling.note_round(before, made, 64, 64)
    assert not sampling.is_finished


def test_alpha_alone_may_be_noisy() -> None:
    """This happens where a shadow catcher shows nothing but shadows."""
    for difference, is_finished in ((0.05, False), (0.005, True)):
        sampling = AdaptiveSampling((32, 32), 0.01)
        before, made = (np.zeros((32, 32, 4), np.float32) for _ in range(2))
        before[..., 3], made[..., 3] = 0.5 + difference, 0.5
        sampling.note_round(before, made, 64, 64)
        assert sampling.is_finished == is_finished


# Refusals ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("threshold", [0.0, -0.01, np.nan, np.inf, "much"])
def test_a_threshold_is_a_number_above_zero(threshold: Any) -> None:
    with pytest.raises(ValueError, match="AdaptiveSampling: threshold must be"):
        AdaptiveSampling(SIZE, threshold)


def test_other_bad_arguments() -> None:
    with pytest.raises(ValueError, match="AdaptiveSampling: min_samples must be an integer from 0 to"):
        AdaptiveSampling(SIZE, 0.01, -1)
    with pytest.raises(ValueError, match="AdaptiveSampling: size must be"):
        AdaptiveSampling((0, 4), 0.01)


def test_each_image_has_its_own(scene: Scene) -> None:
    used = finish(scene, 0.01, 4)[2]
    cases: tuple[tuple[dict[str, Any], str], ...] = (
        ({"sampling": used}, "sampling must be new"),
        ({"sampling": AdaptiveSampling((70, 150), 0.01)}, r"for an image of \(150, 70\) pixels, got \(70, 150\)"),
        ({"sampling": 0.01}, "sampling must be a perfect_bvh.AdaptiveSampling, got float"),
        ({"sampling": AdaptiveSampling(SIZE, 0.01), "passes": ("depth",)}, "passes must hold 'combined'"),
        ({"sampling": AdaptiveSampling(SIZE, 0.01), "tiles": np.ones(TILES, np.bool_)}, "tiles must be None"),
    )
    for options, expected in cases:
        with pytest.raises(ValueError, match=f"render_progressively: .*{expected}"):
            next(render_progressively(scene, CAMERA, **({"size": SIZE} | options)))
