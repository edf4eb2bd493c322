"""The text next to pictures in a 3D viewport: the meaning of colours, in numbers, and a tip at the mouse.

A legend is in the lower left corner, above Blender's own text there; a tip is next to the mouse.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import bpy

from ..events.changes import listen, stop_listening
from ..settings.preferences import redraw_viewports
from . import drawing
from .drawing import (
    MARGIN,
    TEXT_SIZE,
    Color,
    draw_bar,
    draw_lines_2d,
    draw_panel,
    draw_rect,
    draw_text,
    draw_text_panel,
    free_rect,
    panel_text_color,
    pixels,
    text_panel_size,
    text_size,
)

# Drawing over editors: functions that Blender calls for each main region, and the object that a tool shows with them.


T = TypeVar("T")


class DrawHandler:
    """Draws from `add` to `remove`.

    draw: finds its region in `bpy.context`.
    when: "POST_VIEW" to draw in the scene's units, "POST_PIXEL" in the region's pixels.
    space: the kind of editor.
    """

    def __init__(self, draw: Callable[[], None], when: str, space: Any = bpy.types.SpaceView3D) -> None:
        self._draw, self._when, self._space = draw, when, space
        self._handle: Any = None

    def add(self) -> None:
        self._handle = self._space.draw_handler_add(self._draw, (), "WINDOW", self._when)

    def remove(self) -> None:
        self._space.draw_handler_remove(self._handle, "WINDOW")
        self._handle = None


class OneShown(Generic[T]):
    """The object that a tool shows over 3D viewports, one at a time: until `hide`, or until another file is loaded.

    found: the object, None if none is shown.
    """

    def __init__(self) -> None:
        self.found: T | None = None

    def show(self, what: T) -> None:
        """Show an object in place of the current one."""
        self.hide()
        listen(self)
        self.found = what
        redraw_viewports()

    def hide(self) -> None:
        """Show nothing any more; does nothing where nothing is shown."""
        if self.found is None:
            return
        self.found = None
        stop_listening(self)
        self.forget()
        redraw_viewports()

    def forget(self) -> None:
        """Drop the object's data."""

    def on_change(self, what: str) -> None:
        """Do nothing: the object does not depend on the scene."""

    def on_file_change(self) -> None:
        self.hide()


# Close button --------------------------------------------------------------------------------------------------------
# A cross in the corner of a drawing over a 3D viewport, which closes it.
#
# The drawing's own code draws it, as it may cover Blender's gizmos; gizmos only report the mouse's position.


# In points.
SIZE, CROSS, INSET, WIDTH = 18.0, 7.0, 6.0, 1.6


def close_rect(right: float, top: float) -> drawing.Rect:
    """Below and left of a corner, in pixels."""
    inset, size = drawing.pixels(INSET), drawing.pixels(SIZE)
    return drawing.Rect(right - inset - size, top - inset - size, right - inset, top - inset)


def draw_close(rect: drawing.Rect, color: drawing.Color) -> None:
    """The cross, in the middle."""
    x, y, half = (rect.left + rect.right) / 2, (rect.bottom + rect.top) / 2, drawing.pixels(CROSS) / 2
    for slope in (-half, half):
        drawing.draw_lines_2d([(x - half, y - slope), (x + half, y + slope)], color, WIDTH)


def contains(rect: drawing.Rect, x: float, y: float) -> bool:
    """Whether a pixel is within."""
    return rect.left <= x < rect.right and rect.bottom <= y < rect.top


# Color scale ---------------------------------------------------------------------------------------------------------
# The meaning of colours, for a legend: numbers along a bar or next to swatches. Does not depend on Blender.


@dataclass(frozen=True, slots=True)
class Scale:
    """The meaning of colours. caption: their quantity. labels: positions from 0 to 1, and the numbers there.

    levels: the number of swatches in place of a bar, one a level; 0 for a bar.
    """

    caption: str
    labels: tuple[tuple[float, str], ...]
    levels: int = 0


# Legend --------------------------------------------------------------------------------------------------------------


# In points.
SCALE_WIDTH = 220.0
BAR_HEIGHT = 10.0
SWATCH = 14.0
GAP = 6.0
TIP_OFFSET = 18.0


@dataclass(frozen=True, slots=True)
class Section:
    """A part of a legend.

    colors: of its scale, evenly apart from 0 to 1. shown: levels that are drawn, of a scale with swatches.
    """

    lines: tuple[str, ...]
    scale: Scale | None = None
    colors: tuple[Color, ...] = ()
    shown: frozenset[int] = frozenset()


def draw_legend(context: bpy.types.Context, sections: Sequence[Section]) -> None:
    """Draws in the region that is being drawn; in a quad view in one of the four."""
    area, region = context.area, context.region
    if not sections or not is_main(area, region):
        return
    free = free_rect(area, region)
    widths = [_size_of(section)[0] for section in sections]
    heights = [_size_of(section)[1] for section in sections]
    width = max(widths) + 2 * pixels(MARGIN)
    height = sum(heights) + pixels(GAP) * (len(sections) - 1) + 2 * pixels(MARGIN)
    left, bottom = free.left + pixels(MARGIN), max(free.bottom, hud_top(area, region)) + pixels(MARGIN)
    if left + width > free.right or bottom + height > free.top:
        return  # the picture is smaller than the legend
    draw_panel(left, bottom, width, height)
    top = bottom + height - pixels(MARGIN)
    for section, section_height in zip(sections, heights, strict=True):
        _draw_section(section, left + pixels(MARGIN), top)
        top -= section_height + pixels(GAP)


def draw_tip(context: bpy.types.Context, place: tuple[int, int], lines: Sequence[str]) -> None:
    """Draw lines of text to the right of the mouse and below it, or where there is room."""
    width, height = text_panel_size(lines)
    free = free_rect(context.area, context.region)
    offset = pixels(TIP_OFFSET)
    x, y = place[0] + offset, place[1] - offset - height
    if x + width > free.right:
        x = place[0] - offset - width
    if y < free.bottom:
        y = place[1] + offset
    draw_text_panel(max(x, free.left), y, lines)


def is_main(area: bpy.types.Area, region: bpy.types.Region) -> bool:
    """Whether it is the lower left view of a quad view, or the only one."""
    views = [other for other in area.regions if other.type == "WINDOW" and min(other.width, other.height) > 1]
    return min(views, key=lambda view: (view.x, view.y), default=region) == region


def hud_top(area: bpy.types.Area, region: bpy.types.Region) -> float:
    """Above where Blender shows how the last operation can be adjusted."""
    shown = [other for other in area.regions if other.type == "HUD" and other.height > 1 and other.width > 1]
    return max((other.y + other.height - region.y for other in shown), default=0.0)


def _size_of(section: Section) -> tuple[float, float]:
    """(width, height) in pixels."""
    line_height = text_size("")[1]
    width = max((text_size(line)[0] for line in section.lines), default=0.0)
    height = line_height * len(section.lines)
    if section.scale is not None:
        width = max(width, _scale_width(section.scale))
        height += line_height * 2 + pixels(SWATCH if section.scale.levels else BAR_HEIGHT) + pixels(GAP)
    return width, height


def _scale_width(scale: Scale) -> float:
    return pixels((SWATCH + GAP) * scale.levels) if scale.levels else pixels(SCALE_WIDTH)


def _draw_section(section: Section, left: float, top: float) -> None:
    line_height, color = text_size("")[1], panel_text_color()
    for line in section.lines:
        top -= line_height
        draw_text(left, top + 0.25 * line_height, line, color=color)
    scale = section.scale
    if scale is None:
        return
    top -= line_height + pixels(GAP) / 2
    draw_text(left, top + 0.25 * line_height, scale.caption, color=color)
    if scale.levels:
        _draw_swatches(section, scale, left, top - pixels(SWATCH))
    else:
        height = pixels(BAR_HEIGHT)
        draw_bar(left, top - height, pixels(SCALE_WIDTH), height, scale.labels, section.colors, color)


def _draw_swatches(section: Section, scale: Scale, left: float, bottom: float) -> None:
    """One a level, those that are drawn filled."""
    size, color = pixels(SWATCH), panel_text_color()
    for level, (_, label) in enumerate(scale.labels):
        x = left + level * pixels(SWATCH + GAP)
        own = section.colors[level]
        if level in section.shown:
            draw_rect(x, bottom, size, size, own)
        else:
            inner = [(x + 1, bottom + 1), (x + size - 1, bottom + 1), (x + size - 1, bottom + size - 1)]
            draw_lines_2d([*inner, (x + 1, bottom + size - 1)], own, 1.0, is_closed=True)
        width = text_size(label)[0]
        draw_text(x + (size - width) / 2, bottom - pixels(TEXT_SIZE + 2.0), label, color=color)
