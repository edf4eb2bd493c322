"""An image on its way to the screen: as a texture in a region, in the colours that eyes get."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..image.progressive import Image
from ..settings.modes import find_mode

if TYPE_CHECKING:
    import gpu


def picture_of(image: Image, mode: str) -> Image:
    """What is shown of an image: distances become greys, white nearby and black far away."""
    if not find_mode(mode).has_range:
        return image
    from perfect_bvh.render import depth_to_grey

    greys = depth_to_grey(image[..., 0])
    return np.stack([greys, greys, greys, image[..., 3]], axis=-1)


def texture_of(image: Image, mode: str) -> gpu.types.GPUTexture:
    """What is shown of an (H, W, 4) float32 image, row 0 on top."""
    import gpu

    image = picture_of(image, mode)
    height, width = image.shape[:2]
    flipped = np.ascontiguousarray(image[::-1], np.float32)  # a texture begins at the bottom
    buffer = gpu.types.Buffer("FLOAT", flipped.size, flipped.ravel())
    return gpu.types.GPUTexture((width, height), format="RGBA16F", data=buffer)


def draw_texture(
    engine: bpy.types.RenderEngine, scene: bpy.types.Scene, texture: gpu.types.GPUTexture, size: tuple[int, int]
) -> None:
    """Over the whole region that is being drawn. Blender puts the scene's view transform on what is drawn meanwhile.

    size: (width, height) of the region in pixels.
    """
    import gpu
    from gpu_extras.presets import draw_texture_2d

    gpu.state.blend_set("ALPHA_PREMULT")
    engine.bind_display_space_shader(scene)
    draw_texture_2d(texture, (0, 0), *size)
    engine.unbind_display_space_shader()
    gpu.state.blend_set("NONE")
