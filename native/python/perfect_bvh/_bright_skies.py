"""Keeps what is bright in a world's image as long as the image exists: each round of a preview asks again."""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core

_found: dict[int, tuple[weakref.ref[npt.NDArray[Any]], _core.BrightSky]] = {}


def find_bright_sky(image: dict[str, Any], threads: int) -> _core.BrightSky | None:
    """Of an image as the native module takes it; None if its pixels may yet be written to: then nothing is kept."""
    pixels = image["pixels"]
    if not _is_final(pixels):
        return None
    key = id(pixels)
    held = _found.get(key)
    if held is not None and held[0]() is pixels:
        return held[1]
    made = _core.make_bright_sky(image, threads)
    _found[key] = weakref.ref(pixels, lambda _: _found.pop(key, None)), made
    return made


def _is_final(pixels: npt.NDArray[Any]) -> bool:
    """Whether they cannot change: read-only, and they own their memory."""
    return type(pixels) is np.ndarray and pixels.flags.owndata and not pixels.flags.writeable
