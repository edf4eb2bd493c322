"""Detail that a denoiser has removed is restored; noise is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from perfect_bvh import restore_detail
from perfect_bvh.render import add_samples

Image = npt.NDArray[np.float32]
SHAPE = (96, 128, 3)


def blurred(image: Image) -> Image:
    """A denoiser of sorts: the mean of 7 x 7 pixels."""
    for axis in (0, 1):
        image = sum(np.roll(image, step, axis) for step in range(-3, 4)) / np.float32(7)
    return image.astype(np.float32)


def traced(truth: Image, sigma: float, seed: int = 0, done: int = 8, count: int = 8) -> tuple[Image, Image]:
    """An image and its noise after two rounds; sigma: of the image."""
    random = np.random.default_rng(seed)
    one, two = (
        truth + random.normal(0.0, sigma * np.sqrt((done + count) / samples), truth.shape).astype(np.float32)
        for samples in (done, count)
    )
    noise = np.zeros_like(truth)
    add_samples(one, two, done, count, noise=noise)
    return one, noise


def error(image: Image, truth: Image) -> float:
    return float(np.sqrt(np.mean((image - truth) ** 2)))


def restored(image: Image, noise: Image, clean: Image, through: Image, truth: Image | None = None) -> Image:
    """Restores detail of an uneven surface everywhere, or of one with the colours of a converged image."""
    albedo = np.random.default_rng(5).random((*image.shape[:2], 3)) if truth is None else truth
    return restore_detail(image, noise, clean, through, albedo, np.zeros((*image.shape[:2], 3)))


def fine_and_flat() -> Image:
    """Fine stripes on the left, an even wall on the right."""
    truth = np.full(SHAPE, 0.5, np.float32)
    truth[:, :64:2] = 0.8
    return truth


@pytest.mark.parametrize(("done", "count"), [(8, 8), (16, 4), (1, 31)])
def test_noise_has_the_variance_of_the_mean(done: int, count: int) -> None:
    image, noise = traced(np.full(SHAPE, 0.5, np.float32), 0.02, done=done, count=count)
    assert error(image, np.full(SHAPE, 0.5, np.float32)) == pytest.approx(0.02, rel=0.02)
    assert float(np.sqrt(np.mean(noise**2))) == pytest.approx(0.02, rel=0.02)


def test_pixels_that_get_no_more_samples_keep_their_noise() -> None:
    image, noise = traced(np.full(SHAPE, 0.5, np.float32), 0.02)
    before = image.copy(), noise.copy()
    pixels = np.zeros(SHAPE[:2], bool)
    pixels[:, :10] = True
    add_samples(image, np.ones_like(image), 16, 16, pixels, noise)
    for now, then in zip((image, noise), before, strict=True):
        np.testing.assert_array_equal(now[:, 10:], then[:, 10:])
        assert not np.array_equal(now[:, :10], then[:, :10])


def test_the_better_of_both_is_taken_place_by_place() -> None:
    truth = fine_and_flat()
    image, noise = traced(truth, 0.02)
    clean, through = blurred(image), blurred(noise)
    made = restored(image, noise, clean, through)
    fine, flat = np.s_[8:-8, 8:56], np.s_[8:-8, 80:-8]
    assert error(clean[fine], truth[fine]) > 0.1
    assert error(made[fine], truth[fine]) < 1.03 * error(image[fine], truth[fine])
    assert error(made[flat], truth[flat]) < 0.35 * error(image[flat], truth[flat])
    assert error(made, truth) < min(error(image, truth), error(clean, truth))


@pytest.mark.parametrize("sigma", [0.005, 0.05, 0.15, 0.3])
def test_it_is_as_near_as_the_nearer_one_at_any_noise(sigma: float) -> None:
    truth = np.broadcast_to(np.float32(0.5) + 0.1 * np.sin(np.arange(128) * 0.9)[None, :, None], SHAPE).astype("f4")
    image, noise = traced(truth, sigma)
    clean = blurred(image)
    made = restored(image, noise, clean, blurred(noise))
    assert error(made, truth) < 1.02 * min(error(image, truth), error(clean, truth))


def test_what_seldom_samples_find_on_an_even_surface_is_no_detail() -> None:
    """The last round has hit none of them: noise does not reveal them."""
    truth = fine_and_flat()
    image, noise = traced(truth, 0.01)
    clean, through = blurred(image), blurred(noise)
    image[48, 70:120:10] += 2.0
    made = restored(image, noise, clean, through, truth)
    np.testing.assert_array_equal(made[:, 70:], clean[:, 70:])
    assert error(made[8:-8, 8:56], truth[8:-8, 8:56]) < 0.02


def test_no_grain_is_put_back() -> None:
    truth = fine_and_flat()
    image, noise = traced(truth, 0.35)
    clean = blurred(truth)
    np.testing.assert_array_equal(restored(image, noise, clean, np.zeros_like(noise)), clean)


@pytest.mark.parametrize("shape", [(1, 9, 3), (9, 1, 3)])
def test_neighbours_of_uneven_pixels_are_uneven(shape: tuple[int, int, int]) -> None:
    image, clean, zeros = np.ones(shape, np.float32), np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    for weight, given in ((0.1, "albedo"), (0.2, "normal")):
        guides = {"albedo": zeros, "normal": zeros} | {given: zeros.copy()}
        guides[given].reshape(9, 3)[:5, 1] = weight
        made = restore_detail(image, zeros, clean, zeros, **guides).reshape(9, 3)[:, 0]
        assert (made[[0, 1, 2, 7, 8]] == 0.0).all() and (made[3:7] > 0.2).all() and (made < 0.9).all()


def test_a_denoiser_that_does_nothing_changes_nothing() -> None:
    image, noise = traced(fine_and_flat(), 0.05)
    np.testing.assert_allclose(restored(image, noise, image, noise), image, atol=1e-6)


def test_what_has_no_noise_stays() -> None:
    truth = fine_and_flat()
    made = restored(truth, np.zeros_like(truth), blurred(truth), np.zeros_like(truth))
    np.testing.assert_allclose(made, truth, atol=1e-6)


def test_brightness_is_no_matter() -> None:
    image, noise = traced(fine_and_flat(), 0.05)
    given = [image, noise, blurred(image), blurred(noise)]
    for factor in (1e-3, 1e3):
        scaled = restored(*(array * np.float32(factor) for array in given))
        np.testing.assert_allclose(scaled / factor, restored(*given), rtol=1e-3)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, 1e38])
def test_wild_pixels_stay_alone(wrong: float) -> None:
    truth = fine_and_flat()
    image, noise = traced(truth, 0.02)
    clean, through = blurred(image), blurred(noise)
    image[40, 100], noise[40, 100] = wrong, wrong
    made = restored(image, noise, clean, through)
    assert np.isfinite(made).all()
    others = np.ones(SHAPE[:2], bool)
    others[40, 100] = False
    assert error(made[others], truth[others]) < 0.02
    if not np.isfinite(wrong):
        np.testing.assert_array_equal(made[40, 100], clean[40, 100])


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 1, 4), (9, 1, 4), (1, 17, 3), (8, 8, 4)])
def test_images_may_be_small(shape: tuple[int, int, int]) -> None:
    image, noise = traced(np.full(shape, 0.5, np.float32), 0.02)
    clean = np.full(shape, 0.5, np.float32)
    made = restored(image, noise, clean, np.zeros_like(clean))
    assert made.shape == shape and made.dtype == np.float32
    assert (np.abs(made - clean) <= np.abs(image - clean) + 1e-6).all()


def test_opaque_stays_opaque() -> None:
    image, noise = traced(np.full((32, 32, 4), 0.5, np.float32), 0.1)
    clean = np.full_like(image, 0.5)
    for array, alpha in ((image, 1.0), (clean, 1.0), (noise, 0.0)):
        array[..., 3] = alpha
    np.testing.assert_array_equal(restored(image, noise, clean, np.zeros_like(clean))[..., 3], 1.0)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"image": np.zeros((4, 4))}, r"image must have shape \(H, W, 3\) or \(H, W, 4\), got \(4, 4\)"),
        ({"image": np.zeros((0, 4, 3))}, r"image must have shape .*, got \(0, 4, 3\)"),
        ({"noise": np.zeros((4, 4, 4))}, r"noise must have the shape of image, \(4, 4, 3\), got \(4, 4, 4\)"),
        ({"let_through": np.zeros((4, 5, 3))}, r"let_through must have the shape of image"),
        ({"normal": np.zeros((4, 4, 4))}, r"normal must have shape \(4, 4, 3\), got \(4, 4, 4\)"),
    ],
)
def test_wrong_shapes_are_refused(given: dict[str, Any], message: str) -> None:
    names = ("image", "noise", "denoised", "let_through", "albedo", "normal")
    arrays = dict.fromkeys(names, np.zeros((4, 4, 3))) | given
    with pytest.raises(ValueError, match=f"restore_detail: {message}"):
        restore_detail(**arrays)
