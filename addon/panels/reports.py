"""What the last image of the scene cost, and what went wrong."""

from __future__ import annotations

import bpy

from ..statistics.last_result import is_outdated, last_statistics
from ..statistics.messages import messages_of
from ..statistics.not_shown import line_of
from ..statistics.summary import statistics_rows
from .common import RenderPanel, draw_lines, draw_message, text_width

# What a box takes of the width.
BOX = 16
# Of names that stand left of values: what is left free of the panel's width and right of them, in pixels; their part.
BORDERS, GAP = 40, 16
LEAST_PART, MOST_PART = 0.4, 0.5


class PERFECT_BVH_PT_statistics(RenderPanel, bpy.types.Panel):
    """How long each step of the last render or view of this scene took, what it was done to, and messages."""

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
    # A viewport renews them itself: panels would only jump meanwhile.
    if is_old and statistics.source != "Viewport":
        draw_lines(context, layout, "The scene has changed since", icon="INFO")


def _part_of_names(context: bpy.types.Context, names: list[str]) -> float:
    """Of the panel's width: what the longest takes, but where there is too little for both."""
    width = context.region.width / context.preferences.system.ui_scale - BORDERS
    return min(max(LEAST_PART, (max(map(text_width, names)) + GAP) / max(width, 1.0)), MOST_PART)


def draw_messages(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """All of them, in a box: reports of Blender's are seen for a few seconds only."""
    found, line = messages_of(context.scene), line_of(context.scene)
    if not found and not line:
        return
    column = layout.box().column(align=True)
    column.label(text="Messages")
    for message in found:
        draw_message(context, column, message, BOX)
    if line:
        draw_lines(context, column, f"{line}: see Not Shown", icon="INFO", inset=BOX)


CLASSES = (PERFECT_BVH_PT_statistics,)
