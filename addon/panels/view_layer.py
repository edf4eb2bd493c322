"""The passes that the engine writes beside Combined."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ..settings.denoisers import denoising_data_settings
from ..settings.modes import mode_of_render
from .common import RenderPanel, settings_layout


class PERFECT_BVH_PT_passes(RenderPanel, bpy.types.Panel):
    """The passes that the engine writes beside Combined."""

    bl_label = "Data"
    bl_context = "view_layer"
    bl_parent_id = "VIEWLAYER_PT_layer_passes"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        view_layer = context.view_layer
        column = layout.column(heading="Include", align=True)
        column.prop(view_layer, "use_pass_z")
        column.prop(view_layer, "use_pass_normal")
        vector = column.column()
        vector.active = not context.scene.render.use_motion_blur
        vector.prop(view_layer, "use_pass_vector")
        column = layout.column(heading="Indexes", align=True)
        column.prop(view_layer, "use_pass_object_index", text="Object")
        column.prop(view_layer, "use_pass_material_index", text="Material")
        threshold = layout.column()
        threshold.active = mode_of_render(context.scene).shading
        threshold.prop(view_layer, "pass_alpha_threshold")
        denoising = denoising_data_settings(view_layer)
        if denoising is not None:
            layout.column(heading="Denoising").prop(denoising, "denoising_store_passes", text="Data")


class PERFECT_BVH_PT_filter(RenderPanel, bpy.types.Panel):
    """What a view layer may be without."""

    bl_label = "Filter"
    bl_context = "view_layer"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        column = settings_layout(self).column(heading="Include")
        column.active = context.scene.render.use_motion_blur
        column.prop(context.view_layer, "use_motion_blur", text="Motion Blur")


class PERFECT_BVH_PT_override(RenderPanel, bpy.types.Panel):
    """Blender before 5.0 has it with its own engines only."""

    bl_label = "Override"
    bl_context = "view_layer"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings_layout(self).prop(context.view_layer, "material_override")


HAS_OVERRIDE = hasattr(bpy.types, "VIEWLAYER_PT_override")
CLASSES = (PERFECT_BVH_PT_passes, PERFECT_BVH_PT_filter, *(() if HAS_OVERRIDE else (PERFECT_BVH_PT_override,)))
