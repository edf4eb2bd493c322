"""Which boxes are drawn over 3D viewports, and how many they are."""

from __future__ import annotations

import bpy

from ..view3d.overlay import Shown, overlay_of
from .common import EnginePanel, draw_lines, settings_layout


class PERFECT_BVH_PT_overlay(EnginePanel, bpy.types.Panel):
    """The trees' boxes, level by level."""

    bl_label = "Tree Overlay"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        settings = context.scene.perfect_bvh.overlay
        column = layout.column(heading="Show", align=True)
        column.prop(settings, "show_top_level")
        column.prop(settings, "show_active")
        column = layout.column()
        column.active = settings.show_top_level or settings.show_active
        column.prop(settings, "level")
        column.prop(settings, "use_all_to_level")
        column.prop(settings, "color_by")
        column.prop(settings, "use_in_front")
        overlay = overlay_of(context)
        if overlay is None:
            return
        if overlay.message:
            draw_lines(context, layout, overlay.message, icon="ERROR")
        for name, lines in (("Top level", overlay.top_level), ("Active object", overlay.active)):
            if lines is not None and lines.shown is not None:
                draw_lines(context, layout, f"{name}: {describe(lines.shown)}", icon="INFO")
        if settings.show_active and overlay.active is None and not overlay.message:
            draw_lines(context, layout, "The active object has no triangles that rays could meet", icon="INFO")


def describe(shown: Shown) -> str:
    """What is drawn of a tree, in a few words."""
    boxes = f"{shown.count:,} boxes" if shown.count == shown.total else f"{shown.count:,} of {shown.total:,} boxes"
    return f"level {shown.level} of {shown.depth}, {boxes}"


CLASSES = (PERFECT_BVH_PT_overlay,)
