"""The settings that a 3D viewport carries: `space.shading.perfect_bvh`."""

from __future__ import annotations

from dataclasses import replace

import bpy

from .preferences import redraw_for_setting
from .properties import choice, pointer
from .scene_settings import MODE_ITEMS, RenderSettings, read_settings
from .view_settings import PERFECT_BVH_PG_overlay

AS_RENDER = "RENDER"
# Its number must be no mode's, of which there may be more one day.
_MODE_ITEMS = [
    (AS_RENDER, "Same as Render", "The mode in the Render properties", 1000),
    *MODE_ITEMS,
]


class PERFECT_BVH_PG_shading(bpy.types.PropertyGroup):
    """Saved with the screen in the .blend file."""

    mode: choice(
        "Mode", "What this viewport shows in Rendered shading", _MODE_ITEMS, AS_RENDER, update=redraw_for_setting
    )
    overlay: pointer("Overlay", "The boxes of the BVHs that this viewport shows", PERFECT_BVH_PG_overlay)


def overlay_settings(space: bpy.types.SpaceView3D) -> PERFECT_BVH_PG_overlay:
    """Returns a viewport's choice of trees' boxes.

    It is stored with the viewport's shading: Blender does not let add-ons store anything with its overlays.
    """
    return space.shading.perfect_bvh.overlay


def mode_of(scene: bpy.types.Scene, shading: bpy.types.View3DShading) -> str:
    """Returns the mode of a Rendered viewport of `scene`, by the name that `find_mode` takes."""
    own = shading.perfect_bvh.mode
    return (scene.perfect_bvh.mode if own == AS_RENDER else own).lower()


def read_view_settings(scene: bpy.types.Scene, shading: bpy.types.View3DShading) -> RenderSettings:
    """The settings of a Rendered viewport of `scene`."""
    return replace(read_settings(scene, is_viewport=True), mode=mode_of(scene, shading))


CLASSES = (PERFECT_BVH_PG_overlay, PERFECT_BVH_PG_shading)


def register() -> None:
    for settings in CLASSES:
        bpy.utils.register_class(settings)
    bpy.types.View3DShading.perfect_bvh = bpy.props.PointerProperty(
        name="Perfect BVH", description="What this viewport shows in Rendered shading", type=PERFECT_BVH_PG_shading
    )


def unregister() -> None:
    del bpy.types.View3DShading.perfect_bvh
    for settings in reversed(CLASSES):
        bpy.utils.unregister_class(settings)
