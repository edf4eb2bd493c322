"""The panels of reports: statistics, updates, trees, unsupported parts of the scene, and the bench."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any, ClassVar

import bpy

from ..bench.results import HEADINGS, Row, last_results
from ..statistics.last_result import is_outdated, last_statistics, statistics_rows
from ..statistics.messages import messages_of
from ..statistics.not_shown import line_of, was_read
from ..statistics.update_list import FOLD, MORE, row_of, rows_of, updates_of
from ..statistics.words import count_of, duration
from ..sync.not_shown import SELECTABLE
from .common import (
    TABS,
    EnginePanel,
    RenderPanel,
    StudyPanel,
    draw_lines,
    draw_main_button,
    draw_message,
    draw_messages_of,
    draw_props,
    draw_purpose,
    settings_layout,
    text_width,
)

# The cost of the last image of the scene, and the last errors.


# The width of a box's borders.
BOX = 16
# Of names to the left of values: the free part of the panel's width and the space right of them, in pixels; their part.
BORDERS, GAP = 40, 16
LEAST_PART, MOST_PART = 0.4, 0.5


class PERFECT_BVH_PT_statistics(RenderPanel, bpy.types.Panel):
    """The time and data of each step of the last render or view of this scene, and messages."""

    bl_label = "Statistics"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        is_there = last_statistics(context.scene) is not None or bool(messages_of(context.scene))
        return super().poll(context) and is_there

    def draw(self, context: bpy.types.Context) -> None:
        if last_statistics(context.scene) is not None:
            _draw_steps(context, self.layout)
        draw_messages(context, self.layout)


def _draw_steps(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    statistics = last_statistics(context.scene)
    is_old = is_outdated(context.scene)
    rows = statistics_rows(statistics)
    split = layout.split(factor=_part_of_names(context, [name for name, _ in rows]))
    split.active = not is_old
    names, values = split.column(align=True), split.column(align=True)
    names.alignment = "RIGHT"
    for name, value in rows:
        names.label(text=name)
        values.label(text=value)
    # A viewport renews them itself: panels would only jump in between.
    if is_old and statistics.source != "Viewport":
        draw_lines(context, layout, "The scene has changed since", icon="INFO")


def _part_of_names(context: bpy.types.Context, names: list[str]) -> float:
    """Returns the part of the panel's width for the longest name, unless there is too little for both."""
    width = context.region.width / context.preferences.system.ui_scale - BORDERS
    return min(max(LEAST_PART, (max(map(text_width, names)) + GAP) / max(width, 1.0)), MOST_PART)


def draw_messages(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """Draws all messages, in a box: Blender's own reports are visible for a few seconds only."""
    found, line = messages_of(context.scene), line_of(context.scene)
    if not found and not line:
        return
    column = layout.box().column(align=True)
    column.label(text="Messages")
    for message in found:
        draw_message(context, column, message, BOX)
    if line:
        draw_lines(context, column, f"{line}: see Not Shown", icon="INFO", inset=BOX)


# Updates -------------------------------------------------------------------------------------------------------------
# The updates for the last image: objects in a list, and advice for the chosen one.


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
# In pixels at the usual resolution scale: the part of the sidebar's width for tabs and borders, the columns of times
# and shares, and the icon of a name. Names have the rest, and this part of the width at least.
LIST_BORDERS, TIME, SHARE, ICON = 66, 70, 45, 34
LEAST_NAME_PART = 0.46
NARROW = 220  # of the sidebar's width, in the same pixels: there is room for names alone


class PERFECT_BVH_UL_updates(bpy.types.UIList):
    """A row: an update and its objects, its time, and its share of the render."""

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
        elif is_narrow(context):
            layout.label(text=item.short_name, icon=ICONS[item.state])
        else:
            draw_cells(context, layout, fitting_name(context, item), item.time, item.share, ICONS[item.state])

    def draw_filter(self, context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
        layout.prop(self, "filter_name", text="", icon="VIEWZOOM")

    def filter_items(
        self, context: bpy.types.Context, data: bpy.types.AnyType, rows_name: str
    ) -> tuple[list[int], list[int]]:
        word = self.filter_name.lower()
        shown = (
            word in row.name.lower() and row.state not in {FOLD, MORE}
            if word
            else not row.is_folded or data.is_unfolded
            for row in getattr(data, rows_name)
        )
        return [self.bitflag_filter_item if is_shown else 0 for is_shown in shown], []


class PERFECT_BVH_PT_updates(StudyPanel, bpy.types.Panel):
    """The list, and two sentences about its active row."""

    bl_label = "Scene Updates"
    page = "how_to/mesh_costs"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        text = "Which meshes cost most: their share of the rays, and the time of their updates for the last image"
        draw_purpose(context, layout, text)
        statistics, rows = last_statistics(scene), rows_of(scene)
        if statistics is None:
            draw_lines(
                context,
                layout,
                "Render with Perfect BVH to see what was updated",
                icon="INFO",
                inset=TABS,
            )
            return
        if rows is None:
            layout.label(text="Loading...")
            return
        _draw_heading(context, layout)
        row = layout.row(align=True)
        row.label(text="Sort By")
        row.prop(rows, "sort_by", expand=True)
        column = layout.column(align=True)
        if is_narrow(context):
            column.label(text="Object")
        else:
            draw_cells(context, column, "Object", "Time", "Share", "NONE")
        column.template_list("PERFECT_BVH_UL_updates", "", rows, "rows", rows, "active", rows=5, maxrows=10)
        _draw_active(context, layout, rows)


def is_narrow(context: bpy.types.Context) -> bool:
    """Whether numbers next to a row's name would be cut off; those of the active row are below the list."""
    return bool(context.region.width / context.preferences.system.ui_scale < NARROW)


def fitting_name(context: bpy.types.Context, item: bpy.types.PropertyGroup) -> str:
    """A row's name, with the number of its objects short where there is no room for more words."""
    room = _list_width(context) * _name_part(context, item.time) - ICON
    return item.name if text_width(item.name) <= room else item.short_name


def _list_width(context: bpy.types.Context) -> float:
    return max(context.region.width / context.preferences.system.ui_scale - LIST_BORDERS, 1.0)


def _name_part(context: bpy.types.Context, time: str) -> float:
    """Returns the part of a row that its name may have."""
    return max(1.0 - ((TIME if time else 0) + SHARE) / _list_width(context), LEAST_NAME_PART)


def draw_cells(
    context: bpy.types.Context, layout: bpy.types.UILayout, name: str, time: str, share: str, icon: str
) -> None:
    """A row of up to three columns, the numbers flush right."""
    split = layout.split(factor=_name_part(context, time))
    split.label(text=name, icon=icon)
    if time:
        split = split.split(factor=TIME / (TIME + SHARE))
    for cell in (time, share) if time else (share,):
        column = split.row()
        column.alignment = "RIGHT"
        column.label(text=cell)


def _draw_heading(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    scene = context.scene
    statistics, updates = last_statistics(scene), updates_of(scene.session_uid)
    count = updates.changed_count
    what = f"{count_of(count, 'object')} updated in" if count else "No updates, checked in"
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


# Compare -------------------------------------------------------------------------------------------------------------
# Looking into trees: two of one object side by side.


class PERFECT_BVH_PT_compare(StudyPanel, bpy.types.Panel):
    """The two trees to compare, and the button."""

    bl_label = "Compare"
    page = "how_to/compare_builders"

    def draw(self, context: bpy.types.Context) -> None:
        from ..view3d.compare import compare_view

        layout = settings_layout(self)
        draw_purpose(
            context,
            layout,
            "Two BVHs of the active object side by side. SAH: expected cost of a ray. EPO: what overlapping boxes add "
            "to it. Lower is better",
        )
        compare = context.scene.perfect_bvh.compare
        draw_props(layout.column(align=True), compare, "left", "right")
        row = draw_main_button(context, layout, "perfect_bvh.compare", "Compare", "MOD_MIRROR")
        if compare_view.shown() is not None:
            row.operator("perfect_bvh.end_comparison", text="", icon="X")
        draw_messages_of(context, layout, "Compare")


# Not shown -----------------------------------------------------------------------------------------------------------
# A list of what the last image lacks or shows differently from Blender's nodes and settings.


NOT_SHOWN_ICONS = {
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


ALL_SHOWN = "Nothing is missing from the last image"


class PERFECT_BVH_UL_not_shown(bpy.types.UIList):
    """A row: the data-block, and what is not shown. Rows of other scenes are left out."""

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
        layout.label(text=f"{item.name}: {item.text}", icon=NOT_SHOWN_ICONS[item.kind])

    def filter_items(
        self, context: bpy.types.Context, data: bpy.types.AnyType, rows_name: str
    ) -> tuple[list[int], list[int]]:
        rows = getattr(data, rows_name)
        uid, word = context.scene.session_uid, self.filter_name.lower()
        shown = (row.scene_uid == uid and word in f"{row.name} {row.text}".lower() for row in rows)
        return [self.bitflag_filter_item if is_shown else 0 for is_shown in shown], []


class PERFECT_BVH_PT_not_shown(EnginePanel, bpy.types.Panel):
    """The list, and a button that selects the objects of the chosen row."""

    bl_label = "Not Shown"
    bl_options: ClassVar = set()

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and was_read(context.scene)

    def draw(self, context: bpy.types.Context) -> None:
        listed, line = context.window_manager.perfect_bvh_not_shown, line_of(context.scene)
        draw_lines(context, self.layout, line or ALL_SHOWN, icon="INFO" if line else "CHECKMARK")
        if not line:
            return
        self.layout.template_list("PERFECT_BVH_UL_not_shown", "", listed, "rows", listed, "active", rows=4)
        if not 0 <= listed.active < len(listed.rows):
            return
        row = listed.rows[listed.active]
        if row.scene_uid != context.scene.session_uid:
            return
        column = self.layout.column(align=True)
        draw_lines(context, column, f"{row.name}: {row.text}", icon=NOT_SHOWN_ICONS[row.kind])
        draw_lines(context, column, row.advice, icon="INFO")
        if row.kind in SELECTABLE:
            button = self.layout.operator("perfect_bvh.select_not_shown", icon="RESTRICT_SELECT_OFF")
            button.kind, button.session_uid = row.kind, row.session_uid


# Bench ---------------------------------------------------------------------------------------------------------------
# The button that measures the scene, and a table of what that has found.


class PERFECT_BVH_PT_bench(StudyPanel, bpy.types.Panel):
    """The button of the benchmark, and its results."""

    bl_label = "Benchmark"
    page = "how_to/refitting"

    def draw(self, context: bpy.types.Context) -> None:
        text = "Measure for about a minute how this scene's BVHs are best built, and updated when objects move"
        draw_purpose(context, self.layout, text)
        draw_main_button(context, self.layout, "perfect_bvh.bench", "Benchmark This Scene", "TIME")
        draw_messages_of(context, self.layout, "Benchmark This Scene")
        results = last_results(context.scene.session_uid)
        if results is not None:
            draw_table(self.layout, results.table)
            for sentence in dict.fromkeys(results.advice.values()):
                draw_lines(context, self.layout, sentence, icon="INFO", inset=TABS)
            if results.better is not None:
                self.layout.operator("perfect_bvh.compare_advised", icon="MOD_MIRROR")


def draw_table(layout: bpy.types.UILayout, rows: Sequence[Row]) -> None:
    """A box for each part, with a heading."""
    for part, group in groupby(rows, key=lambda row: row.part):
        box = layout.box().column(align=True)
        heading = _draw_cells(box, (part, *HEADINGS[part]))
        heading.active = False
        for row in group:
            _draw_cells(box, (row.name, row.cost, row.gain), row.share)


def _draw_cells(layout: bpy.types.UILayout, cells: tuple[str, str, str], share: float | None = None) -> Any:
    """share: how long a bar behind the last cell is, in parts of the cell; None: there is no bar."""
    split = layout.split(factor=0.36)
    split.label(text=cells[0])
    halves = split.split(factor=0.38)
    for cell, filled in ((cells[1], None), (cells[2], share)):
        column = halves.column()
        column.alignment = "RIGHT" if filled is None else "EXPAND"
        if filled is None:
            column.label(text=cell)
        else:
            column.progress(text=cell, factor=filled)
    return split
