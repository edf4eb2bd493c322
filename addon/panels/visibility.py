"""Which rays see an object, and whether it shows shadows in place of itself: Blender offers that with Cycles only."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ..settings.scene_settings import ENGINE_NAME
from .common import RenderPanel, settings_layout

SHOWN_TYPES = ("MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD")


def has_rays(obj: bpy.types.Object | None) -> bool:
    """Whether rays can meet an object, or its instances, whose settings are its own as well."""
    return obj is not None and (obj.type in SHOWN_TYPES or obj.is_instancer)


class PERFECT_BVH_PT_ray_visibility(RenderPanel, bpy.types.Panel):
    """Which rays meet an object."""

    bl_label = "Ray Visibility"
    bl_context = "object"
    bl_parent_id = "OBJECT_PT_visibility"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and has_rays(context.object)

    def draw(self, context: bpy.types.Context) -> None:
        column, obj = settings_layout(self).column(), context.object
        column.prop(obj, "visible_camera", text="Camera")
        column.prop(obj, "visible_diffuse", text="Diffuse")
        column.prop(obj, "visible_glossy", text="Glossy")
        column.prop(obj, "visible_transmission", text="Transmission")
        column.prop(obj, "visible_volume_scatter", text="Volume Scatter")
        column.prop(obj, "visible_shadow", text="Shadow")


def _draw_mask(panel: bpy.types.Panel, context: bpy.types.Context) -> None:
    """Below Blender's own Holdout."""
    if context.engine == ENGINE_NAME and has_rays(context.object):
        panel.layout.use_property_split = True
        panel.layout.prop(context.object, "is_shadow_catcher")


CLASSES = (PERFECT_BVH_PT_ray_visibility,)


def register() -> None:
    bpy.types.OBJECT_PT_visibility.append(_draw_mask)


def unregister() -> None:
    bpy.types.OBJECT_PT_visibility.remove(_draw_mask)
