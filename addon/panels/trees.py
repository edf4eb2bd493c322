"""Looking into trees: two of one object side by side."""

from __future__ import annotations

from typing import ClassVar

import bpy

from .common import SidebarPanel, draw_messages_of, settings_layout


class PERFECT_BVH_PT_trees(SidebarPanel, bpy.types.Panel):
    """Holds the panels below."""

    bl_label = "Trees"

    def draw(self, context: bpy.types.Context) -> None:
        """Which boxes are drawn wherever boxes are drawn."""
        layout = settings_layout(self)
        overlay = context.scene.perfect_bvh.overlay
        layout.prop(overlay, "level")
        layout.prop(overlay, "color_by")


class TreePanel(SidebarPanel):
    """One of the panels of what can be done with trees."""

    bl_parent_id = "PERFECT_BVH_PT_trees"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}


class PERFECT_BVH_PT_compare(TreePanel, bpy.types.Panel):
    """Which two trees are compared, and the button."""

    bl_label = "Compare"
    bl_options: ClassVar = set()

    def draw(self, context: bpy.types.Context) -> None:
        from ..view3d.compare import compare_view

        layout = settings_layout(self)
        compare = context.scene.perfect_bvh.compare
        column = layout.column(align=True)
        column.prop(compare, "left")
        column.prop(compare, "right")
        row = layout.row(align=True)
        row.operator("perfect_bvh.compare", icon="MOD_MIRROR")
        if compare_view.shown() is not None:
            row.operator("perfect_bvh.end_comparison", text="", icon="X")
        draw_messages_of(context, layout, "Compare")


CLASSES = (PERFECT_BVH_PT_trees, PERFECT_BVH_PT_compare)
