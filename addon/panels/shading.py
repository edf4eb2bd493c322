"""The Viewport Shading popover in Rendered shading: what a viewport shows, and under which light."""

from __future__ import annotations

from typing import Any

import bpy

from ..settings.modes import find_mode
from ..settings.preferences import native_error
from ..settings.scene_settings import ENGINE_NAME
from ..settings.shading_settings import mode_of


class ShadingPanel:
    """In the popover of a viewport that this engine renders."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"
    bl_parent_id = "VIEW3D_PT_shading"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        is_shown = context.engine == ENGINE_NAME and context.space_data.shading.type == "RENDERED"
        return is_shown and native_error() is None


class PERFECT_BVH_PT_shading_lighting(ShadingPanel, bpy.types.Panel):
    """The scene's own light, or Blender's studio."""

    bl_label = "Lighting"

    def draw(self, context: bpy.types.Context) -> None:
        layout, shading = self.layout, context.space_data.shading
        layout.active = find_mode(mode_of(context.scene, shading)).shading
        layout.prop(shading, "use_scene_lights_render")
        layout.prop(shading, "use_scene_world_render")
        if not shading.use_scene_world_render:
            _draw_studio(layout, shading)


class PERFECT_BVH_PT_shading_render_pass(ShadingPanel, bpy.types.Panel):
    """What this viewport shows."""

    bl_label = "Render Pass"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.space_data.shading.perfect_bvh, "mode", text="")


def _draw_studio(layout: bpy.types.UILayout, shading: Any) -> None:
    """As Blender's own engines have it, but for blurring, which Cycles lacks as well."""
    split = layout.split(factor=0.9)
    row = split.column().row()
    row.scale_y = 0.6
    row.template_icon_view(shading, "studio_light", scale_popup=3.0)
    split.operator("screen.userpref_show", emboss=False, text="", icon="PREFERENCES").section = "LIGHTS"
    column = layout.split(factor=0.9).column()
    column.prop(shading, "studiolight_rotate_z", text="Rotation")
    column.prop(shading, "studiolight_intensity")
    column.prop(shading, "studiolight_background_alpha")


CLASSES = (PERFECT_BVH_PT_shading_lighting, PERFECT_BVH_PT_shading_render_pass)
