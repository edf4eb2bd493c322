"""What the Scan button casts, and the button."""

from __future__ import annotations

import bpy

from .common import SidebarPanel, draw_messages_of, settings_layout


class PERFECT_BVH_PT_scan(SidebarPanel, bpy.types.Panel):
    """From where which rays are cast, and what becomes of the points."""

    bl_label = "Scan"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        settings = context.scene.perfect_bvh.scan
        layout.prop(settings, "pattern")
        layout.prop(settings, "sensor")
        column = layout.column(align=True)
        if settings.pattern == "CAMERA":
            column.prop(settings, "width")
            column.prop(settings, "height", text="Y")
        else:
            column.prop(settings, "elevations")
            column.prop(settings, "columns")
            column.prop(settings, "rate")
            column.prop(settings, "max_distance")
        layout.prop(settings, "use_frame_range")
        if settings.use_frame_range:
            layout.prop(settings, "steps_per_frame")
        layout.prop(settings, "point_color")
        layout.prop(settings, "labels")
        layout.prop(settings, "filepath")
        layout.operator("perfect_bvh.scan", icon="OUTLINER_OB_POINTCLOUD")
        draw_messages_of(context, layout, "Scan")


CLASSES = (PERFECT_BVH_PT_scan,)
