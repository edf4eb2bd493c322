"""Image files, as Blender decodes them."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import numpy.typing as npt


def load_image(path: Path) -> bpy.types.Image:
    """The file as an image of Blender, from memory: Wine cannot map files as Blender does when it loads one itself."""
    data = path.read_bytes()
    image = bpy.data.images.new(path.name, 1, 1)
    image.pack(data=data, data_len=len(data))
    image.source = "FILE"
    return image


def read_png(path: Path) -> npt.NDArray[np.uint8]:
    """(H, W, 4) uint8 as stored, row 0 on top; alpha is 255 where the file has none."""
    image = load_image(path)
    try:
        image.colorspace_settings.name = "Non-Color"
        image.alpha_mode = "CHANNEL_PACKED"  # straight alpha: colour is not multiplied by it
        width, height = image.size
        pixels = np.empty(width * height * 4, np.float32)
        image.pixels.foreach_get(pixels)
        return np.rint(pixels.reshape(height, width, 4)[::-1] * 255).astype(np.uint8)
    finally:
        bpy.data.images.remove(image)
