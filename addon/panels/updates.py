"""What was updated for the last image: objects in a list, and what can be done about the one that is chosen."""

from __future__ import annotations

import bpy

from ..statistics.last_result import is_outdated, last_statistics
from ..statistics.update_list import FOLD, MORE, row_of, rows_of, updates_of
from ..statistics.words import count_of, duration
from .common import TABS, SidebarPanel, draw_lines, text_width

ICONS = {
    "kept": "CHECKMARK",
    "unseen": "HIDE_ON",
    "masked": "HIDE_OFF",
    "moved": "OBJECT_ORIGIN",
    "recounted": "PARTICLES",
    "replaced": "MESH_DATA",
    "added": "ADD",
    "removed": "REMOVE",
    "refitted": "MOD_SIMPLEDEFORM",
    "rotated": "FILE_REFRESH",
    "partly_rebuilt": "MOD_REMESH",
    "rebuilt": "MOD_BUILD",
    "built": "ADD",
}
# Of a row: what a name has where there is a time beside it and where there is none; of the rest what a time has.
NAME_PART, LONG_NAME_PART, TIME_PART = 0.46, 0.78, 0.62
# What is left free of the sidebar's width for tabs and borders, and of a name's part for its icon, in pixels at the
# usual resolution scale.
LIST_BORDERS, ICON = 66, 34


class PERFECT_BVH_UL_updates(bpy.types.UIList):
    """A row: what happened to which objects, how long it took, which share of the render they are."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: bpy.types.AnyType,
        item: bpy.types.PropertyGroup,
        icon: int,
        active_data: object,
        active_property: str,
    ) -> None:
        if item.state == FOLD:
            arrow = "DOWNARROW_HLT" if data.is_unfolded else "RIGHTARROW"
            row = layout.row(align=True)
            row.prop(data, "is_unfolded", text="", icon=arrow, emboss=False)
            row.label(text=item.name)
        elif item.state == MORE:
            layout.label(text=item.name, icon="BLANK1")
        else:
            draw_cells(layout, fitting_name(context, item), item.time, item.share, ICONS[item.state])

    def draw_filter(self, context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
        layout.prop(self, "filter_name", text="", icon="VIEWZOOM")

    def filter_items(
        self, context: bpy.types.Context, data: bpy.types.AnyType, rows_name: str
    ) -> tuple[list[int], list[int]]:
        word = self.filter_name.lower()
        shown = (
            word in row.name.lower() and row.state not in {FOLD, MORE} if word else row.is_changed or data.is_unfolded
            for row in getattr(data, rows_name)
        )
        return [self.bitflag_filter_item if is_shown else 0 for is_shown in shown], []


class PERFECT_BVH_PT_updates(SidebarPanel, bpy.types.Panel):
    """The list, and two sentences about its active row."""

    bl_label = "What Was Updated"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        statistics, rows = last_statistics(scene), rows_of(scene)
        if statistics is None:
            draw_lines(context, layout, "Nothing was rendered with Perfect BVH yet", icon="INFO", inset=TABS)
            return
        if rows is None:
            layout.label(text="Being listed")
            return
        _draw_heading(context, layout)
        column = layout.column(align=True)
        draw_cells(column, "Object", "Time", "Share", "NONE")
        column.template_list("PERFECT_BVH_UL_updates", "", rows, "rows", rows, "active", rows=5, maxrows=10)
        _draw_active(context, layout, rows)


def fitting_name(context: bpy.types.Context, item: bpy.types.PropertyGroup) -> str:
    """A row's name, with the number of its objects short where there is no room for more words."""
    width = context.region.width / context.preferences.system.ui_scale - LIST_BORDERS
    room = width * (NAME_PART if item.time else LONG_NAME_PART) - ICON
    return item.name if text_width(item.name) <= room else item.short_name


def draw_cells(layout: bpy.types.UILayout, name: str, time: str, share: str, icon: str) -> None:
    """A row of up to three columns, the numbers flush right."""
    split = layout.split(factor=NAME_PART if time else LONG_NAME_PART)
    split.label(text=name, icon=icon)
    if time:
        split = split.split(factor=TIME_PART)
    for cell in (time, share) if time else (share,):
        column = split.row()
        column.alignment = "RIGHT"
        column.label(text=cell)


def _draw_heading(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    scene = context.scene
    statistics, updates = last_statistics(scene), updates_of(scene.session_uid)
    count = updates.changed_count
    what = f"{count_of(count, 'object')} updated in" if count else "Nothing to update, which took"
    text = f"{statistics.source}, frame {statistics.frame:g}: {what} {duration(statistics.report.milliseconds)}"
    draw_lines(context, layout, text, inset=TABS)
    if is_outdated(scene) and statistics.source != "Viewport":
        draw_lines(context, layout, "The scene has changed since", icon="INFO", inset=TABS)


def _draw_active(context: bpy.types.Context, layout: bpy.types.UILayout, rows: bpy.types.PropertyGroup) -> None:
    if row_of(rows, rows.active) is None:
        return
    item = rows.rows[rows.active]
    column = layout.column(align=True)
    draw_lines(context, column, item.name, icon=ICONS[item.state], inset=TABS)
    draw_lines(context, column, rows.done, icon="BLANK1", inset=TABS)
    draw_lines(context, column, rows.advice, icon="INFO", inset=TABS)
    if rows.facts:
        draw_lines(context, column, rows.facts, icon="BLANK1", inset=TABS)
    if rows.note:
        draw_lines(context, column, rows.note, icon="ERROR", inset=TABS)


CLASSES = (PERFECT_BVH_PT_updates,)
LISTS = (PERFECT_BVH_UL_updates,)
