"""Takes the noise out of images of few samples, with what is known of each pixel's surface to guide it."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from os import PathLike, fsdecode
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from . import _core, _oidn
from ._arrays import as_array, check_count
from ._batches import Progress, share_of
from ._render_arguments import check_choice, check_size
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
    """What `Denoiser` uses: "OpenImageDenoise 2.3.3", or "Joint Filter". libraries: see there."""
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
    """An image with less noise: what a `Denoiser` made for this one image returns, which explains the arguments."""
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
    """Denoises images of one size, as many as come: what takes time to set up is kept. Any thread may use it.

    size: (width, height) in pixels.
    prefilter: "accurate": albedo and normal are denoised first, then taken as they are, which keeps most detail and
        takes three times as long; "fast": they are taken as noisy; "none": as free of noise, which those of
        `render_passes` are from some 16 samples a pixel on. Cycles' settings of the same names. The joint filter knows
        no difference.
    quality: of OpenImageDenoise. "balanced" takes twice as long as "fast", and "high" five times.
    threads: at most so many; 0, the default, for as many as the engine uses (`set_thread_count`).
    backend: "oidn": OpenImageDenoise; "joint": an edge-avoiding wavelet of our own, which needs no library and leaves
        more noise; "auto", the default: the former where it can be used, and for images of 16 pixels or more each way,
        as it darkens what has no surroundings.
    libraries: paths of OpenImageDenoise's library (libOpenImageDenoise.so.2, OpenImageDenoise.dll or
        libOpenImageDenoise.dylib) to try first. Then follow the one that this process has loaded, as Blender does, the
        system's, and that of the package pyoidn.

    Raises ValueError for bad arguments, EngineError if "oidn" cannot be used, MemoryError.
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
        """What denoises: "OpenImageDenoise 2.3.3", or "Joint Filter"."""
        self.complaints: tuple[str, ...] = reasons
        """Why a library that is there is not used, a sentence each."""
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
        """The same image with less noise, as a new array. The same arrays give the same bits.

        color: (H, W, 3) or (H, W, 4) scene-linear. The fourth channel, alpha, is handed on as it is; where there is
            neither alpha nor colour, nothing is put.
        albedo, normal: (H, W, 3), what guides it, as means of each pixel's samples: the surface's colour from 0 to 1,
            and its normal, -1 to 1 in any space; zero where there is nothing. None where they are not known.
        progress: called with the share done, 0 to 1; returning False raises `Cancelled`. Ctrl-C works too.

        Numbers that are not finite count as 0. Returns float32 of `color`'s shape.

        Raises ValueError for bad arguments, Cancelled, EngineError or MemoryError if OpenImageDenoise fails.
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
        """Into memory that the filters know, without what is no number."""
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
        """Those of the guides first, if they are wanted, which write where the last one reads."""
        assert self._device is not None
        made = []
        if self._prefilter == "accurate":
            for name in names[1:]:
                guide = {name: self._images[name], "output": self._images[name]}
                made.append(_oidn.Filter(self._device, guide, self._quality))
        images = {name: self._images[name] for name in names} | {"output": self._image("output")}
        if "normal" in images and "albedo" not in images:  # which the library wants of normals
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
