"""The bytes of an image file, as Blender decodes them."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import numpy.typing as npt


def read_png(path: Path) -> npt.NDArray[np.uint8]:
    """(H, W, 4) uint8 as stored, row 0 on top; alpha is 255 where the file has none."""
    image = bpy.data.images.load(str(path))
    try:
        image.colorspace_settings.name = "Non-Color"
        image.alpha_mode = "CHANNEL_PACKED"  # colour and alpha as they are, not multiplied
        width, height = image.size
        pixels = np.empty(width * height * 4, np.float32)
        image.pixels.foreach_get(pixels)
        return np.rint(pixels.reshape(height, width, 4)[::-1] * 255).astype(np.uint8)
    finally:
        bpy.data.images.remove(image)
