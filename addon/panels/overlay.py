"""Which boxes of the trees are drawn over 3D viewports; what they tell stands in the viewports themselves."""

from __future__ import annotations

import bpy

from ..settings.preferences import native_error


class PERFECT_BVH_PT_overlay(bpy.types.Panel):
    """The trees' boxes, level by level, with any render engine."""

    bl_label = "Tree Overlay"
    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"
    bl_parent_id = "VIEW3D_PT_overlay"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return native_error() is None

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        settings = context.scene.perfect_bvh.overlay
        layout.active = context.space_data.overlay.show_overlays
        row = layout.row()
        row.prop(settings, "show_top_level")
        row.prop(settings, "show_active")
        column = layout.column()
        column.active = settings.show_top_level or settings.show_active
        column.prop(settings, "level")
        row = column.row()
        row.prop(settings, "use_all_to_level")
        row.prop(settings, "use_in_front")
        split = column.split(factor=0.25)
        split.label(text="Color")
        split.row(align=True).prop(settings, "color_by", expand=True)


CLASSES = (PERFECT_BVH_PT_overlay,)
