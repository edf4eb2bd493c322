"""What the last image lacks or shows otherwise than Blender's nodes and settings say, as a list to go through."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ..statistics.not_shown import line_of, told
from ..sync.not_shown import SELECTABLE
from .common import EnginePanel, draw_lines

ICONS = {
    "library": "LIBRARY_DATA_BROKEN",
    "dark": "OUTLINER_OB_LIGHT",
    "object": "OBJECT_DATA",
    "scan": "OUTLINER_OB_POINTCLOUD",
    "shape": "MOD_SUBSURF",
    "material": "MATERIAL",
    "image": "IMAGE_DATA",
    "light": "LIGHT",
    "world": "WORLD",
    "setting": "SCENE",
}


class PERFECT_BVH_UL_not_shown(bpy.types.UIList):
    """A row: what it is of, and what is not shown of it. Rows of other scenes are left out."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: object,
        item: bpy.types.PropertyGroup,
        icon: int,
        active_data: object,
        active_property: str,
    ) -> None:
        layout.label(text=f"{item.name}: {item.text}", icon=ICONS[item.kind])

    def filter_items(
        self, context: bpy.types.Context, data: bpy.types.AnyType, rows_name: str
    ) -> tuple[list[int], list[int]]:
        rows = getattr(data, rows_name)
        uid, word = context.scene.session_uid, self.filter_name.lower()
        shown = (row.scene_uid == uid and word in f"{row.name} {row.text}".lower() for row in rows)
        return [self.bitflag_filter_item if is_shown else 0 for is_shown in shown], []


class PERFECT_BVH_PT_not_shown(EnginePanel, bpy.types.Panel):
    """The list, and a button that selects what the chosen row is about."""

    bl_label = "Not Shown"
    bl_options: ClassVar = set()

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and bool(told(context.scene))

    def draw(self, context: bpy.types.Context) -> None:
        listed = context.window_manager.perfect_bvh_not_shown
        draw_lines(context, self.layout, line_of(context.scene), icon="INFO")
        self.layout.template_list("PERFECT_BVH_UL_not_shown", "", listed, "rows", listed, "active", rows=4)
        if not 0 <= listed.active < len(listed.rows):
            return
        row = listed.rows[listed.active]
        if row.scene_uid != context.scene.session_uid:
            return
        column = self.layout.column(align=True)
        draw_lines(context, column, f"{row.name}: {row.text}", icon=ICONS[row.kind])
        draw_lines(context, column, row.advice, icon="INFO")
        if row.kind in SELECTABLE:
            button = self.layout.operator("perfect_bvh.select_not_shown", icon="RESTRICT_SELECT_OFF")
            button.kind, button.session_uid = row.kind, row.session_uid


CLASSES = (PERFECT_BVH_PT_not_shown,)
LISTS = (PERFECT_BVH_UL_not_shown,)
