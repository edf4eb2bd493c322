"""Removes the noise from images of few samples, guided by the known surface of each pixel."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterable
from os import PathLike, fsdecode
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from . import _core, _oidn
from ._arrays import Progress, as_array, share_of
from ._checks import check_choice, check_count, check_number
from ._render_arguments import check_size
from .errors import EngineError

Image = npt.NDArray[np.float32]
Backend = Literal["auto", "oidn", "joint"]
Prefilter = Literal["accurate", "fast", "none"]
DenoiseQuality = Literal["high", "balanced", "fast"]
Paths = Iterable[str | PathLike[str]]

JOINT_NAME = "Joint Filter"
_UNKNOWN_ALBEDO = 0.5
_LEAST_SIDE = 16


def denoiser_name(libraries: Paths = ()) -> str:
    """Returns what a `Denoiser` would use: "OpenImageDenoise 2.3.3", or "Joint Filter". libraries: see there."""
    library, _ = _oidn.find_library(_as_paths(libraries))
    return JOINT_NAME if library is None else f"{_oidn.NAME} {library.version}"


def denoise(
    color: npt.ArrayLike,
    albedo: npt.ArrayLike | None = None,
    normal: npt.ArrayLike | None = None,
    *,
    prefilter: Prefilter = "accurate",
    quality: DenoiseQuality = "balanced",
    threads: int = 0,
    backend: Backend = "auto",
    libraries: Paths = (),
    progress: Progress | None = None,
) -> Image:
    """Returns an image with less noise, using a new `Denoiser`, which explains the arguments."""
    shape = as_array("denoise", "color", color).shape
    if len(shape) != 3:
        raise ValueError(f"denoise: color must have shape (H, W, 3) or (H, W, 4), got {shape}")
    made = Denoiser(
        (shape[1], shape[0]),
        prefilter=prefilter,
        quality=quality,
        threads=threads,
        backend=backend,
        libraries=libraries,
    )
    return made.denoise(color, albedo, normal, progress)


class Denoiser:
    """Denoises any number of images of one size, and keeps the costly setup. Any thread may use it.

    Args:
        size: (width, height) in pixels.
        prefilter: How albedo and normal are used. "accurate": they are denoised first, then treated as free of noise,
            which keeps most detail and takes three times as long; "fast": they are treated as noisy; "none": they are
            treated as free of noise, which those of `render_passes` are from some 16 samples a pixel on. Cycles'
            settings of the same names. The joint filter ignores it.
        quality: Of OpenImageDenoise. "balanced" takes twice as long as "fast", and "high" five times.
        threads: The largest number of threads; 0, the default, for as many as the engine uses (`set_thread_count`).
        backend: "oidn": OpenImageDenoise; "joint": our own edge-avoiding wavelet filter, which needs no library and
            leaves more noise; "auto", the default: OpenImageDenoise where it is available, for images of 16 pixels or
            more each way, as it darkens smaller ones.
        libraries: Paths of OpenImageDenoise's library (libOpenImageDenoise.so.2, OpenImageDenoise.dll or
            libOpenImageDenoise.dylib) to try first. After these come the one that this process has loaded, as Blender
            does, the system's, and that of the package pyoidn.

    Raises:
        ValueError: For bad arguments, EngineError if "oidn" cannot be used, MemoryError.
    """

    def __init__(
        self,
        size: tuple[int, int],
        *,
        prefilter: Prefilter = "accurate",
        quality: DenoiseQuality = "balanced",
        threads: int = 0,
        backend: Backend = "auto",
        libraries: Paths = (),
    ) -> None:
        self.size = check_size("Denoiser", size)
        self._prefilter = check_choice("Denoiser", "prefilter", prefilter, get_args(Prefilter))
        self._quality = check_choice("Denoiser", "quality", quality, get_args(DenoiseQuality))
        self._threads = check_count("Denoiser", "threads", threads, 0)
        check_choice("Denoiser", "backend", backend, get_args(Backend))
        paths = _as_paths(libraries)
        library, reasons = (None, ()) if backend == "joint" else _oidn.find_library(paths)
        if backend == "auto" and min(self.size) < _LEAST_SIDE:
            library, reasons = None, ()
        if backend == "oidn" and library is None:
            raise EngineError(f"Denoiser: {'; '.join(reasons) or 'there is no ' + _oidn.NAME}: use backend='auto'")
        self.name = JOINT_NAME if library is None else f"{_oidn.NAME} {library.version}"
        """The name of the denoiser: "OpenImageDenoise 2.3.3", or "Joint Filter"."""
        self.complaints: tuple[str, ...] = reasons
        """The reasons why existing libraries are not used, a sentence each."""
        self._lock = threading.Lock()
        self._images: dict[str, Image] = {}
        self._filters: dict[tuple[str, ...], tuple[_oidn.Filter, ...]] = {}
        self._device = None if library is None else _oidn.Device(library, self._threads or _core.thread_count())

    def denoise(
        self,
        color: npt.ArrayLike,
        albedo: npt.ArrayLike | None = None,
        normal: npt.ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> Image:
        """Returns the same image with less noise, as a new array. The same arrays give the same bits.

        Numbers that are not finite count as 0. Returns float32 of `color`'s shape.

        Args:
            color: (H, W, 3) or (H, W, 4) scene-linear. The fourth channel, alpha, is returned unchanged. Pixels with
                neither alpha nor colour stay empty.
            albedo, normal: (H, W, 3), the guides, as means of each pixel's samples: the surface's colour from 0 to
                1, and its normal, -1 to 1 in any space; zero where there is no surface. None where they are not known.
            progress: Called with the share done, 0 to 1; returning False raises `Cancelled`. Ctrl-C works too.

        Raises:
            ValueError: For bad arguments, Cancelled, EngineError or MemoryError if OpenImageDenoise fails.
        """
        pixels = self._check("color", color, (3, 4))
        guides = {"albedo": albedo, "normal": normal}
        given = {"color": pixels} | {
            name: self._check(name, guide, (3,)) for name, guide in guides.items() if guide is not None
        }
        names = tuple(given)
        with self._lock:
            for name, image in given.items():
                self._take(name, image)
            if self._device is None:
                self._filter_jointly(names, progress)
            else:
                self._filter(names, progress)
            result = np.empty(pixels.shape, np.float32)
            result[..., :3] = self._images["output"]
            result[..., 3:] = pixels[..., 3:]
        if pixels.shape[2] == 4:
            result[~pixels.any(axis=-1)] = 0.0
        return result

    def _check(self, name: str, value: npt.ArrayLike, channels: tuple[int, ...]) -> npt.NDArray[np.generic]:
        array = as_array("denoise", name, value)
        width, height = self.size
        if array.ndim != 3 or array.shape[:2] != (height, width) or array.shape[2] not in channels:
            wanted = " or ".join(f"({height}, {width}, {count})" for count in channels)
            raise ValueError(f"denoise: {name} must have shape {wanted}, got {array.shape}")
        return array

    def _take(self, name: str, image: npt.NDArray[np.generic]) -> None:
        """Copies an image into the filters' memory, with 0 in place of NaN and infinities."""
        held = self._image(name)
        with np.errstate(over="ignore", invalid="ignore"):
            held[...] = image[..., :3]
        if not np.isfinite(held).all():
            held[~np.isfinite(held)] = 0.0

    def _image(self, name: str) -> Image:
        if name not in self._images:
            width, height = self.size
            self._images[name] = np.zeros((height, width, 3), np.float32)
        return self._images[name]

    def _filter_jointly(self, names: tuple[str, ...], progress: Progress | None) -> None:
        color, albedo, normal = (
            self._images[name] if name in names else None for name in ("color", "albedo", "normal")
        )
        assert color is not None
        _core.joint_filter(color, albedo, normal, self._image("output"), self._threads, progress)

    def _filter(self, names: tuple[str, ...], progress: Progress | None) -> None:
        filters = self._filters.get(names)
        if filters is None:
            filters = self._filters[names] = self._make_filters(names)
        for row, each in enumerate(filters):
            each.run(share_of(progress, row / len(filters), 1.0 / len(filters)))

    def _make_filters(self, names: tuple[str, ...]) -> tuple[_oidn.Filter, ...]:
        """Makes the filters: first those of the guides, if requested, whose output the last one reads."""
        assert self._device is not None
        made = []
        if self._prefilter == "accurate":
            for name in names[1:]:
                guide = {name: self._images[name], "output": self._images[name]}
                made.append(_oidn.Filter(self._device, guide, self._quality))
        images = {name: self._images[name] for name in names} | {"output": self._image("output")}
        if "normal" in images and "albedo" not in images:  # the library needs an albedo with normals
            images["albedo"] = self._image("unknown albedo")
            images["albedo"].fill(_UNKNOWN_ALBEDO)
        is_clean = self._prefilter != "fast"
        made.append(_oidn.Filter(self._device, images, self._quality, hdr=True, cleanAux=is_clean))
        return tuple(made)


def _as_paths(libraries: Paths) -> tuple[str, ...]:
    given = [libraries] if isinstance(libraries, str | PathLike) else libraries
    try:
        return tuple([fsdecode(path) for path in given])
    except TypeError:
        raise ValueError(f"Denoiser: libraries must be paths of files, got {libraries!r}") from None


# Pixel filter --------------------------------------------------------------------------------------------------------

# The variance of the Blackman-Harris window over its whole width, in parts of the width's square; that of a pixel.
_WINDOW_VARIANCE, _PIXEL_VARIANCE = 0.019179, 1.0 / 12.0
_MOST_SHIFTED = 0.2  # to each neighbour at once


def apply_pixel_filter(image: npt.ArrayLike, filter_width: float = 1.5) -> Image:
    """Returns means of pixels' own samples, filtered to be like "combined": edges get its width.

    "denoising_color", and the output of a `Denoiser` for it, have means over squares, one pixel wide. "combined" has
    the wider filter of the renderer. A pixel and its neighbours are weighted such that the sum has that filter's
    variance. A filter that is no wider than a pixel changes nothing.

    Args:
        image: (H, W, C).
        filter_width: That of the render, see `render_passes`.

    Returns:
        float32 of that shape, a new array.

    Raises:
        ValueError: For bad arguments.
    """
    pixels = as_array("apply_pixel_filter", "image", image).astype(np.float32)
    if pixels.ndim != 3 or 0 in pixels.shape:
        raise ValueError(f"apply_pixel_filter: image must have shape (H, W, C), got {pixels.shape}")
    width = 2.0 * check_number("apply_pixel_filter", "filter_width", filter_width, 0.0, 16.0)
    shifted = 0.5 * max(_WINDOW_VARIANCE * width**2 - _PIXEL_VARIANCE, 0.0)
    times = math.ceil(shifted / _MOST_SHIFTED)
    for axis in (0, 1) * times:
        sides = np.pad(pixels, [(1, 1) if axis == side else (0, 0) for side in range(3)], mode="edge")
        before, after = (sides[:-2], sides[2:]) if axis == 0 else (sides[:, :-2], sides[:, 2:])
        pixels = (pixels + shifted / times * ((before - pixels) + (after - pixels))).astype(np.float32, copy=False)
    return pixels


# Restore detail ------------------------------------------------------------------------------------------------------
# Restores detail that a denoiser has removed from an image along with the noise.
#
# The error of a denoised image is its smoothed-away detail; that of the traced image is its noise. Which of the two is
# nearer to the converged image varies over the image: foliage of many samples is blurred, a wall is not. The mean of
# both with the least error follows from their difference, from the amount of noise, and from the share of noise that
# the denoiser lets through. None of these needs the converged image (Stein 1981, "Estimation of the Mean of a
# Multivariate Normal Distribution"). The share that comes through is found by experiment: the same image with other
# noise is denoised as well (Ramani, Blu and Unser 2008, "Monte-Carlo SURE"). Firmino, Frisvad and Jensen 2022,
# "Progressive Denoising of Monte Carlo Rendered Images", mix renderers' images like that, by a network.
#
# Detail is restored only where surfaces have some. On an even surface only the light varies, and denoisers handle that
# well. Rare bright samples on it would be mistaken for detail where the noise estimate misses them. Detail is not
# restored either where noise is a large part of the brightness: it would be visible as grain, at any error.


Values = npt.NDArray[np.float32]

_BLOCK_SIZE = 8  # pixels each way that are judged together, with smooth transitions
# Of the image's mean, added to the brightness that errors are compared with: errors are not more visible in the dark.
_DARK = 0.03
# Errors above the pixel's own brightness are clamped: fireflies would otherwise dominate their blocks.
_FARTHEST = 1.0
# Differences of colours or normals of neighbouring pixels below which there is surely no detail, above which there is.
_EVEN, _UNEVEN = 0.03, 0.2
# Noise, in parts of the brightness, up to which detail is restored in full, and from which it is not restored at all.
_QUIET, _GRAINY = 0.15, 0.45
_NORMAL_WEIGHT = 0.5  # of normals, -1 to 1, compared with colours, 0 to 1


def restore_detail(
    image: npt.ArrayLike,
    noise: npt.ArrayLike,
    denoised: npt.ArrayLike,
    let_through: npt.ArrayLike,
    albedo: npt.ArrayLike,
    normal: npt.ArrayLike,
) -> Image:
    """Mixes a traced image and the denoised one, place by place, to be nearest to the converged image.

    All arrays but the guides have the same shape. Where `noise` is zero all around, only `image` counts, so it must be
    of more than one round of samples. `denoised` is kept in pixels of `image` that are not finite, on even surfaces and
    in strong noise. Returns float32 of that shape, a new array.

    Args:
        image: (H, W, C) with C 3 or 4, scene-linear: "combined" of `render_progressively`.
        noise: The array of the same name in `noise` of `render_progressively`.
        denoised: The output of a `Denoiser` for "denoising_color", after `apply_pixel_filter`.
        let_through: How much `denoised` decreases if the `noise` of "denoising_color" is subtracted from that. The
            difference of two images that a faster denoiser has made with the same guides is good enough, filtered too.
        albedo, normal: (H, W, 3), the guides.

    Raises:
        ValueError: For arrays of another shape.
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
    """(H, W) 0 to 1: how much surfaces differ between a pixel or one next to it and their neighbours."""
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
    """(H, W) 0 to 1: the share of the traced image in the mean.

    If the traced image is off by e and the denoised one by f, the error E[(f + s (e - f))^2] is least at
    s = 1 - E[e (e - f)] / E[(e - f)^2].
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
    """Clamps outliers."""
    return np.clip(_finite(values), -_FARTHEST, _FARTHEST)


def _finite(values: Values) -> Values:
    return np.nan_to_num(values, copy=False, nan=0.0, posinf=0.0, neginf=0.0)


def _block_means(values: Values) -> Values:
    """Averages blocks: (H, W) to (blocks down, blocks across). The blocks around each count half as much."""
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
    """Interpolates (blocks down, blocks across) to (H, W), linearly between the middles of blocks."""
    down, across = (_between(length, count) for length, count in zip(shape, shares.shape, strict=True))
    return np.asarray(down @ shares @ across.T, np.float32)


def _between(length: int, count: int) -> Values:
    """(length, count): for each pixel along a side, the weights of the blocks whose middles lie around it."""
    places = (np.arange(length) + 0.5) / _BLOCK_SIZE - 0.5
    return np.maximum(1.0 - np.abs(np.clip(places, 0, count - 1)[:, np.newaxis] - np.arange(count)), 0.0).astype(
        np.float32
    )
