"""What the last image of the scene cost."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from ..statistics.last_result import is_outdated, last_statistics
from ..statistics.summary import statistics_rows
from .common import RenderPanel, draw_lines

SHOWN_WARNINGS = 3


class PERFECT_BVH_PT_statistics(RenderPanel, bpy.types.Panel):
    """How long each step of the last render, preview or view of this scene took, and what it was done to."""

    bl_label = "Statistics"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and last_statistics(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        statistics = last_statistics(context.scene)
        is_old = is_outdated(context.scene)
        split = self.layout.split(factor=0.4)
        split.active = not is_old
        names, values = split.column(align=True), split.column(align=True)
        names.alignment = "RIGHT"
        for name, value in statistics_rows(statistics):
            names.label(text=name)
            values.label(text=value)
        _draw_warnings(context, self.layout, (*statistics.report.warnings, *statistics.complaints))
        # A viewport renews them itself: panels would only jump meanwhile.
        if is_old and statistics.source != "Viewport":
            draw_lines(context, self.layout, "The scene has changed since", icon="INFO")


def _draw_warnings(context: bpy.types.Context, layout: bpy.types.UILayout, warnings: Sequence[str]) -> None:
    """What could not be read: reports of it are seen for a few seconds only."""
    for warning in warnings[:SHOWN_WARNINGS]:
        draw_lines(context, layout, warning, icon="ERROR")
    more = len(warnings) - SHOWN_WARNINGS
    if more > 0:
        draw_lines(context, layout, f"and {more:,} more: see the Info editor", icon="BLANK1")


CLASSES = (PERFECT_BVH_PT_statistics,)
