"""Blender's studio lights that are images: what lights viewports that are to do without the scene's world."""

from __future__ import annotations

import traceback
from dataclasses import dataclass
from functools import partial

import bpy
import numpy as np
import numpy.typing as npt

from ...settings.editors import redraw_viewports


@dataclass(frozen=True, slots=True, eq=False)
class StudioImage:
    """pixels: (H, W, 4) float32 scene-linear, equirectangular, row 0 at the bottom. None could be loaded if empty."""

    pixels: npt.NDArray[np.float32]


_loaded: dict[str, StudioImage] = {}
_asked: set[str] = set()


def studio_image(path: str) -> StudioImage | None:
    """The image in this file; None while it is loaded, which must wait as nothing may be loaded by what draws."""
    if path not in _loaded and path not in _asked:
        _asked.add(path)
        bpy.app.timers.register(partial(_load, path), first_interval=0.0, persistent=True)
    return _loaded.get(path)


def _load(path: str) -> None:
    """From a timer."""
    pixels = np.zeros((0, 0, 4), np.float32)
    try:
        image = bpy.data.images.load(path)
    except RuntimeError as error:
        traceback.print_exception(error)
    else:
        width, height = image.size
        pixels = np.empty((height, width, 4), np.float32)
        image.pixels.foreach_get(pixels.reshape(-1))
        bpy.data.images.remove(image)
    pixels.flags.writeable = False
    _loaded[path] = StudioImage(pixels)
    redraw_viewports()
