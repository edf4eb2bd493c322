"""A chart over a 3D viewport of what trees cost from frame to frame: where it stands, and how it is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy

from .. import drawing
from ..close_button import close_rect, draw_close
from .chart_layout import ChartLayout, cost_range, cost_ticks, frame_ticks, without_crowd
from .decay_words import ACTIONS, heading_of, key_of, sentence_of

if TYPE_CHECKING:
    from .decay import Decay

# In points.
HEIGHT, LEAST_HEIGHT, MARGIN = 250.0, 215.0, 12.0
KEY_SAMPLE, KEY_GAP = 24.0, 18.0
AXIS_WIDTH, CURVE_WIDTH, MARK_SIZE = 44.0, 1.8, 3.6
LEAST_CURVES = 40.0  # how high they are at least
SHARE = 0.45  # of the viewport's height, at most
COLORS = {"refit": (0.90, 0.62, 0.0), "governed": (0.25, 0.62, 0.88), "rebuild": (0.84, 0.37, 0.0)}
ORDER = ("refit", "rebuild", "governed")  # the last is drawn over the others, and thinner
MARKED = ("rebuilt", "partly_rebuilt", "rotated")
FAINT = 0.2
HEADING_SIZE = 12.0
SMALL = 10.0  # text beside the curves, in points


@dataclass(frozen=True, slots=True)
class Key:
    """Of a curve, or of a mark where there is no color. width: with what is between it and the next, in pixels."""

    text: str
    width: float
    color: drawing.Color | None = None
    action: str = ""


def panel_of(area: bpy.types.Area, region: bpy.types.Region) -> drawing.Rect:
    """What the chart covers: the lowest part of what is free."""
    free, margin = drawing.free_rect(area, region), drawing.pixels(MARGIN)
    height = max(drawing.pixels(LEAST_HEIGHT), min(drawing.pixels(HEIGHT), SHARE * (free.top - free.bottom)))
    bottom = free.bottom + margin
    return drawing.Rect(free.left + margin, bottom, free.right - margin, bottom + height)


def layout_of(decay: Decay, panel: drawing.Rect, top: float | None = None, sentence_lines: int = 1) -> ChartLayout:
    """Of the curves within the panel: below `top`, that of the panel without it, and above so many lines of text."""
    step, margin = drawing.text_size("")[1], drawing.pixels(MARGIN)
    axis = drawing.pixels(AXIS_WIDTH)
    bottom = panel.bottom + margin + (1.2 + sentence_lines) * step
    top = (panel.top if top is None else top) - 0.9 * step
    costs = [cost for policy in COLORS for cost in decay.costs(policy)]
    low, high = cost_range(costs)
    width, height = max(panel.right - panel.left - axis - 2 * margin, 1.0), max(top - bottom, 1.0)
    return ChartLayout(panel.left + axis, bottom, width, height, decay.frames[0], decay.frames[-1], low, high)


# Drawing -------------------------------------------------------------------------------------------------------------


def draw_chart(context: bpy.types.Context, decay: Decay, *, is_old: bool) -> None:
    """Over the region that is being drawn; of a quad view that is one of the four. is_old: the scene has changed."""
    panel = panel_of(context.area, context.region)
    margin, step = drawing.pixels(MARGIN), drawing.text_size("")[1]
    drawing.draw_panel(panel.left, panel.bottom, panel.right - panel.left, panel.top - panel.bottom)
    text, cross = drawing.panel_text_color(), close_rect(panel.right, panel.top)
    draw_close(cross, text)
    heading = wrapped(heading_of(decay, is_old=is_old), cross.left - panel.left - 2 * margin, HEADING_SIZE)
    for number, line in enumerate(heading):
        y = panel.top - margin - (0.8 + number) * step
        drawing.draw_text(panel.left + margin, y, line, HEADING_SIZE, text)
    if decay.rows:
        _draw_rows(context, decay, panel, panel.top - margin - len(heading) * step)


def _draw_rows(context: bpy.types.Context, decay: Decay, panel: drawing.Rect, top: float) -> None:
    """What was measured. top: where the heading ends."""
    margin, step, text = drawing.pixels(MARGIN), drawing.text_size("")[1], drawing.panel_text_color()
    frame = context.scene.frame_current
    row = next((number for number, one in enumerate(decay.rows) if one.frame == frame), None)
    room = panel.right - panel.left - 2 * margin
    keys = in_lines(_keys_of(decay, row), room)
    sentence = [] if row is None else wrapped(sentence_of(decay.rows[row]), room, SMALL)
    # Curves stay where they are, whichever frame is shown: the longest of all sentences has room.
    longest = max((sentence_of(one) for one in decay.rows), key=len)
    layout = layout_of(decay, panel, top - len(keys) * step, len(wrapped(longest, room, SMALL)))
    if layout.height < drawing.pixels(LEAST_CURVES):  # rather curves than words
        sentence = []
        layout = layout_of(decay, panel, top - len(keys) * step, 0)
    if layout.height < drawing.pixels(LEAST_CURVES):
        keys = []
        layout = layout_of(decay, panel, top, 0)
    for number, line in enumerate(keys):
        _draw_keys(line, panel.left + margin, top - (1.0 + number) * step)
    _draw_axes(layout, text)
    _draw_curves(decay, layout)
    if layout.first <= frame <= layout.last:
        x = layout.x_of(frame)
        drawing.draw_lines_2d([(x, layout.bottom), (x, layout.bottom + layout.height)], text, 1.0)
    for number, part in enumerate(reversed(sentence)):
        drawing.draw_text(panel.left + margin, panel.bottom + 0.8 * margin + number * step, part, SMALL, text)


def wrapped(text: str, room: float, size: float) -> list[str]:
    """Its lines, each no wider than so many pixels, unless it is a single word."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and drawing.text_size(longer, size)[0] > room:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def in_lines(keys: Sequence[Key], room: float) -> list[list[Key]]:
    """As many in a line as are no wider than so many pixels."""
    lines: list[list[Key]] = [[]]
    for key in keys:
        if lines[-1] and sum(one.width for one in (*lines[-1], key)) > room:
            lines.append([])
        lines[-1].append(key)
    return lines


def _draw_axes(layout: ChartLayout, text: drawing.Color) -> None:
    """Lines at round costs, numbers at them and at frames."""
    faint, step = (*text[:3], FAINT), drawing.text_size("")[1]
    right = layout.left + layout.width
    for cost in cost_ticks(layout.low, layout.high):
        y = layout.place(layout.first, cost)[1]
        drawing.draw_lines_2d([(layout.left, y), (right, y)], faint, 1.0)
        label = f"{cost:,.10g}"
        width = drawing.text_size(label, SMALL)[0]
        drawing.draw_text(layout.left - width - drawing.pixels(6.0), y - 0.25 * step, label, SMALL, text)
    room = drawing.pixels(44.0)
    most = max(2, int(layout.width / room))
    for frame in without_crowd(frame_ticks(layout.first, layout.last, most), layout, room):
        x, label = layout.x_of(frame), str(frame)
        width = drawing.text_size(label, SMALL)[0]
        drawing.draw_text(x - width / 2, layout.bottom - step, label, SMALL, text)


def _draw_curves(decay: Decay, layout: ChartLayout) -> None:
    frames = [row.frame for row in decay.rows]
    for policy in ORDER:
        points = [layout.place(*point) for point in zip(frames, decay.costs(policy), strict=True)]
        drawing.draw_lines_2d(points, COLORS[policy], CURVE_WIDTH if policy == "governed" else 2.0 * CURVE_WIDTH)
        if len(points) == 1:
            _draw_mark("rotated", points[0], COLORS[policy])
    costs = decay.costs("governed")
    for number in decay.rebuilds():
        _draw_mark(decay.rows[number].policies["governed"].action, layout.place(frames[number], costs[number]))


def _draw_mark(action: str, place: drawing.Point, color: drawing.Color | None = None) -> None:
    """A square for a new tree, a diamond for new parts, a small square for rotations."""
    x, y = place
    size = drawing.pixels(MARK_SIZE)
    color = drawing.panel_text_color() if color is None else color
    if action == "partly_rebuilt":
        size *= 1.35
        corners = [(x - size, y), (x, y - size), (x + size, y), (x, y + size)]
        drawing.draw_polygon(corners, color)
    else:
        size *= 1.0 if action == "rebuilt" else 0.6
        drawing.draw_rect(x - size, y - size, 2 * size, 2 * size, color)


def _keys_of(decay: Decay, row: int | None) -> list[Key]:
    """Of the curves, with what they cost in a row, and of the marks that there are."""
    found = [(key_of(decay, policy, row), COLORS[policy], "") for policy in COLORS]
    taken = {decay.rows[number].policies["governed"].action for number in decay.rebuilds()}
    marks = [(f"Governor: {ACTIONS[action].lower()}", None, action) for action in MARKED if action in taken]
    around = drawing.pixels(KEY_SAMPLE + KEY_GAP)
    return [Key(text, around + drawing.text_size(text)[0], color, action) for text, color, action in (*found, *marks)]


def _draw_keys(keys: Sequence[Key], x: float, y: float) -> None:
    text, sample = drawing.panel_text_color(), drawing.pixels(KEY_SAMPLE)
    middle = y + drawing.pixels(4.0)
    for key in keys:
        if key.color is not None:
            drawing.draw_lines_2d([(x, middle), (x + 0.75 * sample, middle)], key.color, 3.0)
        else:
            _draw_mark(key.action, (x + 0.4 * sample, middle))
        drawing.draw_text(x + sample, y, key.text, color=text)
        x += key.width
