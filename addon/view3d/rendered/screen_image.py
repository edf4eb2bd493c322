"""An image on its way to the screen: as textures in a region, in the colours that eyes get."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ...image.canvas import Canvas, Image, Place
from ...settings.modes import find_mode

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


@dataclass(frozen=True, slots=True)
class ScreenPatch:
    """Some rows on the graphics card. number: of the change that it shows. shape: (rows, columns) of its pixels."""

    number: int
    shape: tuple[int, int]
    texture: gpu.types.GPUTexture


class ScreenImage:
    """What a region shows of a canvas. size: (width, height) of the image; it is stretched over the region."""

    def __init__(self) -> None:
        self.size = (1, 1)
        self.patches: dict[Place, ScreenPatch] = {}

    def fetch(self, canvas: Canvas, mode: str) -> None:
        """Take what is new, from a canvas that has something."""
        found = canvas.patches({place: patch.number for place, patch in self.patches.items()})
        before, self.patches, self.size = self.patches, {}, canvas.size
        for patch in found:
            if patch.pixels is None:
                self.patches[patch.place] = before[patch.place]
            else:
                texture = texture_of(patch.pixels, mode)
                self.patches[patch.place] = ScreenPatch(patch.number, patch.pixels.shape[:2], texture)


def draw_patches(
    engine: bpy.types.RenderEngine, scene: bpy.types.Scene, image: ScreenImage, region_size: tuple[int, int]
) -> None:
    """Each over its rows of the region. Blender puts the scene's view transform on what is drawn meanwhile.

    region_size: (width, height) in pixels.
    """
    import gpu
    from gpu_extras.presets import draw_texture_2d

    gpu.state.blend_set("ALPHA_PREMULT")
    engine.bind_display_space_shader(scene)
    wider, higher = (length / full for length, full in zip(region_size, image.size, strict=True))
    for place, patch in image.patches.items():
        rows, columns = (length * place.divisor for length in patch.shape)
        bottom = image.size[1] - place.rows[0] - rows
        draw_texture_2d(patch.texture, (0, bottom * higher), columns * wider, rows * higher)
    engine.unbind_display_space_shader()
    gpu.state.blend_set("NONE")
