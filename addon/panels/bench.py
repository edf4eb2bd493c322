"""The button that measures the scene, and a table of what that has found."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import bpy

from ..bench.results import last_results
from ..bench.table import HEADINGS, Row
from .common import SidebarPanel, draw_lines, draw_messages_of


class PERFECT_BVH_PT_bench(SidebarPanel, bpy.types.Panel):
    """Measures the scene and shows what that has found."""

    bl_label = "Bench"

    def draw(self, context: bpy.types.Context) -> None:
        text = "Measures builders and policies on this scene for about a minute"
        draw_lines(context, self.layout, text)
        self.layout.operator("perfect_bvh.bench", icon="TIME")
        draw_messages_of(context, self.layout, "Bench This Scene")
        results = last_results(context.scene.session_uid)
        if results is not None:
            draw_table(self.layout, results.table)
            for sentence in dict.fromkeys(results.advice.values()):
                draw_lines(context, self.layout, sentence, icon="INFO")


def draw_table(layout: bpy.types.UILayout, rows: Sequence[Row]) -> None:
    """A box for each part, with a heading."""
    for part, group in groupby(rows, key=lambda row: row.part):
        box = layout.box().column(align=True)
        _draw_cells(box, (part, *HEADINGS[part]), is_heading=True)
        for row in group:
            _draw_cells(box, (row.name, row.cost, row.gain))


def _draw_cells(layout: bpy.types.UILayout, cells: tuple[str, str, str], *, is_heading: bool = False) -> None:
    split = layout.split(factor=0.36)
    split.active = not is_heading
    split.label(text=cells[0])
    halves = split.split(factor=0.44)
    halves.active = not is_heading
    for cell in cells[1:]:
        column = halves.column()
        column.alignment = "RIGHT"
        column.label(text=cell)


CLASSES = (PERFECT_BVH_PT_bench,)
