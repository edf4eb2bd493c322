"""What the add-on's panels share."""

from __future__ import annotations

import textwrap

import bpy

from ..properties import ENGINE_NAME

# Panels are narrow, and labels do not wrap.
LINE_LENGTH = 48


class RenderPanel:
    """A panel of the Render properties that is shown with this engine."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = frozenset({ENGINE_NAME})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.engine in cls.COMPAT_ENGINES


def wrapped(text: str) -> list[str]:
    """The lines of `text` as a panel shows them."""
    return textwrap.wrap(text, LINE_LENGTH)


def draw_lines(layout: bpy.types.UILayout, text: str, icon: str = "NONE") -> None:
    """A text of several lines, the first with an icon."""
    column = layout.column(align=True)
    for number, line in enumerate(wrapped(text)):
        column.label(text=line, icon=icon if number == 0 else "NONE")
