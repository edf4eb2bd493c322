"""Puts back what a denoiser has taken from an image although it was no noise.

A denoised image is off by what was smoothed away, the traced one by its noise. Which of them is nearer to the converged
image differs from place to place: foliage of many samples is blurred, a wall is not. The mean of both that has the
least error follows from how much they differ, from how much noise there is, and from how much of it the denoiser has
let through; none of which takes the converged image to be known (Stein 1981, "Estimation of the Mean of a Multivariate
Normal Distribution"). How much comes through is found by trying: the same image with other noise is denoised as well
(Ramani, Blu and Unser 2008, "Monte-Carlo SURE"). Renderers' images are mixed like that, by a network, in Firmino,
Frisvad and Jensen 2022, "Progressive Denoising of Monte Carlo Rendered Images".

Detail is looked for where surfaces have some. On an even one light alone varies, of which denoisers make more; and what
few samples find there, bright and seldom, would be taken for detail wherever it is not seen in the noise. Nor is any
put back where noise is a good part of the brightness: it would be seen as grain, whatever the error.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ._arrays import as_array

Image = npt.NDArray[np.float32]
Values = npt.NDArray[np.float32]

_BLOCK_SIZE = 8  # pixels each way that are judged together, smoothly between them
# Of the image's mean, added to what errors are seen beside: in the dark they are seen no better.
_DARK = 0.03
# What is farther off than its own brightness is no matter of degree: fireflies would decide over their blocks.
_FARTHEST = 1.0
# By so much colours or normals of neighbouring pixels differ where there is surely none, surely some detail.
_EVEN, _UNEVEN = 0.03, 0.2
# Noise, in parts of the brightness, at which detail is put back in full, not any more.
_QUIET, _GRAINY = 0.15, 0.45
_NORMAL_WEIGHT = 0.5  # of -1 to 1, beside colours of 0 to 1


def restore_detail(
    image: npt.ArrayLike,
    noise: npt.ArrayLike,
    denoised: npt.ArrayLike,
    let_through: npt.ArrayLike,
    albedo: npt.ArrayLike,
    normal: npt.ArrayLike,
) -> Image:
    """The mean of a traced image and the denoised one that is nearest to the converged image, weighed place by place.

    image: (H, W, C) with C 3 or 4, scene-linear: "combined" of `render_progressively`.
    noise: what that puts into its `noise` under the same name.
    denoised: what a `Denoiser` makes of "denoising_color".
    let_through: by how much that is less if "denoising_color" is less its own `noise`. The difference of two images
        that a quicker denoiser has made with the same guides will do.

    albedo, normal: (H, W, 3), what guides it.

    All but the guides of one shape. Where `noise` is zero all around, `image` counts alone; so it must not be of a
    single round of samples. `denoised` stays in pixels of `image` that are not finite, on even surfaces and in much
    noise. Returns float32 of that shape, a new array.

    Raises ValueError for arrays of another shape.
    """
    given = {"image": image, "noise": noise, "denoised": denoised, "let_through": let_through}
    arrays = {name: as_array("restore_detail", name, array) for name, array in given.items()}
    shape = arrays["image"].shape
    if len(shape) != 3 or shape[2] not in (3, 4) or 0 in shape:
        raise ValueError(f"restore_detail: image must have shape (H, W, 3) or (H, W, 4), got {shape}")
    for name, array in arrays.items():
        if array.shape != shape:
            raise ValueError(f"restore_detail: {name} must have the shape of image, {shape}, got {array.shape}")
    raw, error, clean, through = (array.astype(np.float32, copy=False) for array in arrays.values())
    share = _share_of_raw(raw[..., :3], error[..., :3], clean[..., :3], through[..., :3])
    share = (share * _unevenness(_guide("albedo", albedo, shape), _guide("normal", normal, shape)))[..., np.newaxis]
    mixed = clean + (raw - clean) * share
    return np.where(np.isfinite(mixed), mixed, clean)


def _guide(name: str, value: npt.ArrayLike, shape: tuple[int, ...]) -> Image:
    array = as_array("restore_detail", name, value)
    if array.shape != (*shape[:2], 3):
        raise ValueError(f"restore_detail: {name} must have shape {(*shape[:2], 3)}, got {array.shape}")
    return _finite(array.astype(np.float32))


def _unevenness(albedo: Image, normal: Image) -> Values:
    """(H, W) 0 to 1, whether surfaces differ between a pixel or one beside it and its neighbours."""
    largest = np.zeros(albedo.shape[:2], np.float32)
    for guide, weight in ((albedo, 1.0), (normal, _NORMAL_WEIGHT)):
        for ahead, behind in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
            step = np.abs(guide[ahead] - guide[behind]).max(axis=2, initial=0.0) * np.float32(weight)
            for side in (ahead, behind):
                np.maximum(largest[side], step, out=largest[side])
    for ahead, behind in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
        before = largest.copy()
        np.maximum(largest[ahead], before[behind], out=largest[ahead])
        np.maximum(largest[behind], before[ahead], out=largest[behind])
    place = np.clip((largest - _EVEN) / (_UNEVEN - _EVEN), 0.0, 1.0)
    smooth: Values = place * place * (3.0 - 2.0 * place)
    return smooth


def _share_of_raw(raw: Image, error: Image, clean: Image, through: Image) -> Values:
    """(H, W) 0 to 1, how much of the traced image is in the mean.

    With it off by e, the denoised one by f, the error E[(f + s (e - f))^2] is least at s = 1 - E[e (e - f)] /
    E[(e - f)^2].
    """
    with np.errstate(invalid="ignore", over="ignore"):
        brightness = np.maximum(clean, 0.0).mean(axis=2)
        scale = (1.0 / (brightness + _DARK * _finite(brightness).mean() + 1e-12))[..., np.newaxis]
        own, let_through = _seen(error * scale), _seen(through * scale)
        apart = _block_means(np.square(_seen((raw - clean) * scale)).mean(axis=2))
        noise = _block_means((own * (own - let_through)).mean(axis=2))
        shares = np.clip(1.0 - np.maximum(noise, 0.0) / np.maximum(apart, 1e-12), 0.0, 1.0)
        grain = np.sqrt(_block_means(np.square(own).mean(axis=2)))
        shares *= np.clip((_GRAINY - grain) / (_GRAINY - _QUIET), 0.0, 1.0)
    return _spread(shares.astype(np.float32), raw.shape[:2])


def _seen(values: Image) -> Image:
    """As far as it counts."""
    return np.clip(_finite(values), -_FARTHEST, _FARTHEST)


def _finite(values: Values) -> Values:
    return np.nan_to_num(values, copy=False, nan=0.0, posinf=0.0, neginf=0.0)


def _block_means(values: Values) -> Values:
    """(H, W) to (blocks down, blocks across): means of each block and, by half as much, of those around it."""
    sums = [_block_sums(values), _block_sums(np.ones_like(values))]
    for axis in (0, 1):
        for number, whole in enumerate(sums):
            padded = np.pad(whole, [(1, 1) if axis == side else (0, 0) for side in (0, 1)])
            before, behind = (padded[:-2], padded[2:]) if axis == 0 else (padded[:, :-2], padded[:, 2:])
            sums[number] = whole + np.float32(0.5) * (before + behind)
    means: Values = sums[0] / sums[1]
    return means


def _block_sums(values: Values) -> Values:
    for axis in (0, 1):
        values = np.add.reduceat(values, np.arange(0, values.shape[axis], _BLOCK_SIZE), axis=axis)
    return values


def _spread(shares: Values, shape: tuple[int, ...]) -> Values:
    """(blocks down, blocks across) to (H, W), linear between the middles of blocks."""
    down, across = (_between(length, count) for length, count in zip(shape, shares.shape, strict=True))
    return np.asarray(down @ shares @ across.T, np.float32)


def _between(length: int, count: int) -> Values:
    """(length, count) of each pixel along a side, the weights of the blocks whose middles lie around it."""
    places = (np.arange(length) + 0.5) / _BLOCK_SIZE - 0.5
    return np.maximum(1.0 - np.abs(np.clip(places, 0, count - 1)[:, np.newaxis] - np.arange(count)), 0.0).astype(
        np.float32
    )
