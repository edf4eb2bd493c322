"""Whether a Rendered viewport shows the scene's lights and its world: the switches in its Shading popover.

Without the world a studio light replaces it, as with Blender's own engines: turned and as bright as the popover says.
Behind the scene it is visible only as much as its World Opacity says, over the world's plain color.

Modules that need the native engine are imported where they are used: without it the add-on must still register.
"""

from __future__ import annotations

import traceback
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import bpy
import numpy as np
import numpy.typing as npt

from ...settings.preferences import redraw_viewports

if TYPE_CHECKING:
    from perfect_bvh import Appearance

# Blender's studio lights that are images: what lights viewports that are to do without the scene's world.


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
    """Loads an image, from a timer."""
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


# View lighting -------------------------------------------------------------------------------------------------------


# Where Blender has no image, or has not loaded it yet.
GREY = (0.5, 0.5, 0.5)


@dataclass(frozen=True, slots=True)
class Studio:
    """The light in place of the world. rotation: in radians. opacity: of the image behind the scene, before `color`."""

    image: StudioImage | None
    rotation: float
    intensity: float
    opacity: float
    color: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class ViewLighting:
    """uses_lights: those of the scene. studio: None for the scene's own world."""

    uses_lights: bool = True
    studio: Studio | None = None

    def light(self, appearance: Appearance, world_lights: int) -> Appearance:
        """The same under other light. world_lights: how many of the last lights belong to the world."""
        if appearance.world is None:  # a mode that asks for no light
            return appearance
        if not (self.uses_lights and self.studio is None):
            count = len(appearance.lights.kinds)
            is_of_world = np.arange(count) >= count - world_lights
            kept = np.where(is_of_world, self.studio is None, self.uses_lights)
            names = ("kinds", "positions", "axes", "powers", "sizes", "cones", "casts_shadow")
            columns = {name: getattr(appearance.lights, name)[kept] for name in names}
            appearance = replace(appearance, lights=replace(appearance.lights, **columns))
        return appearance if self.studio is None else _with_studio(appearance, self.studio)


def lighting_of(shading: bpy.types.View3DShading, scene: bpy.types.Scene) -> ViewLighting:
    """Reads the lighting from a viewport's shading."""
    uses_lights = shading.use_scene_lights_render
    if shading.use_scene_world_render:
        return ViewLighting(uses_lights)
    light = shading.selected_studio_light
    image = studio_image(light.path) if light is not None and light.type == "WORLD" else None
    color = (0.0, 0.0, 0.0) if scene.world is None else tuple(scene.world.color)
    numbers = (shading.studiolight_rotate_z, shading.studiolight_intensity, shading.studiolight_background_alpha)
    return ViewLighting(uses_lights, Studio(image, *numbers, color))


def _with_studio(appearance: Appearance, studio: Studio) -> Appearance:
    from perfect_bvh.appearance import ImageTexture, World

    behind = np.array(studio.color) * (1.0 - studio.opacity)
    strength = studio.intensity
    if studio.image is None or not studio.image.pixels.size:
        world = World(tuple(np.multiply(GREY, strength).tolist()))
        backdrop = World(tuple((behind + np.multiply(GREY, strength * studio.opacity)).tolist()))
        return replace(appearance, world=world, backdrop=backdrop)
    images, first = [*appearance.images, ImageTexture(studio.image.pixels)], len(appearance.images)
    world = World((strength,) * 3, first, studio.rotation)
    backdrop = World(tuple(behind.tolist()))
    if studio.opacity > 0.0:
        pixels = studio.image.pixels.copy()
        pixels[..., :3] = pixels[..., :3] * (strength * studio.opacity) + behind
        images.append(ImageTexture(pixels))
        backdrop = World((1.0,) * 3, first + 1, studio.rotation)
    return replace(appearance, images=tuple(images), world=world, backdrop=backdrop)
