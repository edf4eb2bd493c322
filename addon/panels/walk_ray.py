"""The button that walks a ray, and those that step through what it does."""

from __future__ import annotations

from typing import ClassVar

import bpy

from .common import draw_messages_of
from .trees import TreePanel

BUTTONS = (
    ("FIRST", "REW"),
    ("PREVIOUS", "PREV_KEYFRAME"),
    ("PREVIOUS_BOX", "FRAME_PREV"),
    ("PLAY", "PLAY"),
    ("NEXT_BOX", "FRAME_NEXT"),
    ("NEXT", "NEXT_KEYFRAME"),
    ("LAST", "FF"),
)


class PERFECT_BVH_PT_walk_ray(TreePanel, bpy.types.Panel):
    """Which step is shown is told in the viewport."""

    bl_label = "Walk a Ray"
    bl_options: ClassVar = set()

    def draw(self, context: bpy.types.Context) -> None:
        from ..view3d.walk import walk_view
        from ..view3d.walk.shown_walk import place_of

        layout = self.layout
        walk = walk_view.shown()
        row = layout.row(align=True)
        row.operator("perfect_bvh.walk_ray", icon="CURVE_PATH")
        if walk is None:
            draw_messages_of(context, layout, "Walk a Ray")
            return
        row.operator("perfect_bvh.walk_step", text="", icon="X").to = "OFF"
        if walk.is_old(context.scene):
            draw_messages_of(context, layout, "Walk a Ray")
            return
        row = layout.row(align=True)
        row.alignment = "CENTER"
        for to, icon in BUTTONS:
            shown = "PAUSE" if to == "PLAY" and walk.is_playing else icon
            row.operator("perfect_bvh.walk_step", text="", icon=shown).to = to
        row = layout.row()
        row.alignment = "CENTER"
        row.label(text=place_of(walk.index, len(walk.steps)))
        draw_messages_of(context, layout, "Walk a Ray")


CLASSES = (PERFECT_BVH_PT_walk_ray,)
