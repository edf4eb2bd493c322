"""What is written over a viewport of a ray's walk: the step's sentence, what the colors mean, and a count of each."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy

from . import drawing
from .legend import hud_top

if TYPE_CHECKING:
    from .walk_steps import Counters, WalkStep

Color = tuple[float, float, float]

SENTENCE_SIZE = 13.0
SWATCH = 9.0  # in points
COLUMN = 172.0  # of names, in points; the counts stand right of it
COUNT_WIDTH = 72.0
GAP = 14.0
LEAST_LINE = 12  # characters


@dataclass(frozen=True, slots=True)
class Row:
    """color: None for what has none in the picture."""

    name: str
    count: str
    color: Color | None = None


def rows_of(counters: Counters, total: Counters) -> list[Row]:
    """counters: with the step that is shown. total: with all of them."""
    from . import walk_picture as picture

    return [
        Row("Boxes Tested", f"{counters.boxes_tested:,}"),
        Row("Boxes Hit", f"{counters.boxes_hit:,}", picture.WAITING),
        Row("Boxes Missed", f"{counters.boxes_missed:,}", picture.MISSED),
        Row("Boxes Pruned", f"{counters.boxes_pruned:,}", picture.PRUNED),
        Row("Boxes Entered", f"{counters.boxes_entered:,}", picture.ENTERED),
        Row("Triangles Tested", f"{counters.triangles_tested:,}", picture.TESTED),
        Row("Triangles Hit", f"{counters.triangles_hit:,}", picture.HIT),
        Row("Nodes and Instances Visited", f"{counters.visits:,}"),
        Row("Cost (Visits + Triangles)", f"{counters.cost:,} of {total.cost:,}"),
    ]


def heading(steps: Sequence[WalkStep], index: int) -> str:
    """Such as "Step 12 of 57: Enters a box at level 3 of Tree.004: of 8 inside 2 hit, 6 missed"."""
    return f"Step {index + 1:,} of {len(steps):,}: {steps[index].sentence}"


def draw_legend(context: bpy.types.Context, steps: Sequence[WalkStep], index: int, note: str = "") -> None:
    """In the lower left corner of the region that is being drawn; where there is little room, the sentence alone.

    note: a line below the sentence, "" for none.
    """
    free = drawing.free_rect(context.area, context.region)
    left = free.left + drawing.pixels(GAP)
    bottom = max(free.bottom, hud_top(context.area, context.region)) + drawing.pixels(GAP)
    width = free.right - left - drawing.pixels(GAP + 2 * drawing.MARGIN)
    lines = [line for text in (heading(steps, index), note) if text for line in wrap(text, width)]
    rows = rows_of(steps[index].counters, steps[-1].counters)
    size, gap = _size_of(rows), drawing.pixels(6.0)
    words = drawing.text_panel_size(lines, SENTENCE_SIZE)[1]
    if left + size[0] <= free.right and bottom + size[1] + gap + words <= free.top:
        _draw_rows(left, bottom, size, rows)
        bottom += size[1] + gap
    drawing.draw_text_panel(left, bottom, lines, SENTENCE_SIZE)


def wrap(text: str, width: float) -> list[str]:
    """Lines that are no wider, in pixels, as far as words allow."""
    whole = drawing.text_size(text, SENTENCE_SIZE)[0]
    if whole <= width:
        return [text]
    count = max(LEAST_LINE, int(len(text) * width / whole))
    lines = textwrap.wrap(text, count)
    while count > LEAST_LINE and max(drawing.text_size(line, SENTENCE_SIZE)[0] for line in lines) > width:
        count -= 1
        lines = textwrap.wrap(text, count)
    return lines


def _size_of(rows: Sequence[Row]) -> tuple[float, float]:
    margin = 2 * drawing.pixels(drawing.MARGIN)
    return drawing.pixels(COLUMN + COUNT_WIDTH) + margin, len(rows) * drawing.text_size("")[1] + margin


def _draw_rows(left: float, bottom: float, size: tuple[float, float], rows: Sequence[Row]) -> None:
    step, margin = drawing.text_size("")[1], drawing.pixels(drawing.MARGIN)
    swatch, edge = drawing.pixels(SWATCH), drawing.pixels(1.0)
    drawing.draw_panel(left, bottom, *size)
    color = drawing.panel_text_color()
    for number, row in enumerate(reversed(rows)):
        base = bottom + margin + number * step + 0.2 * step
        if row.color is not None:
            x, y = left + margin, base - 0.05 * step
            outline = (*color[:3], 0.5)  # of what would be too like the panel
            drawing.draw_rect(x - edge, y - edge, swatch + 2 * edge, swatch + 2 * edge, outline, drawing.pixels(3.0))
            drawing.draw_rect(x, y, swatch, swatch, row.color, drawing.pixels(2.0))
        drawing.draw_text(left + margin + 1.8 * swatch, base, row.name, color=color)
        right = left + size[0] - margin - drawing.text_size(row.count)[0]
        drawing.draw_text(right, base, row.count, color=color)
