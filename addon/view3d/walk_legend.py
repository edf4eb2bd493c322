"""What is written over a viewport of a ray's walk: the step's sentence, what the colors mean, and a count of each."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy

from . import drawing

if TYPE_CHECKING:
    from .walk_steps import Counters, WalkStep

Color = tuple[float, float, float]

SENTENCE_SIZE = 13.0
SWATCH = 9.0  # in points
COLUMN = 172.0  # of names, in points; the counts stand right of it
COUNT_WIDTH = 72.0
GAP = 14.0


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
    """In the lower left corner of the region that is being drawn. note: a line below the sentence, "" for none."""
    free = drawing.free_rect(context.area, context.region)
    left, bottom = free.left + drawing.pixels(GAP), free.bottom + drawing.pixels(GAP)
    height = _draw_rows(left, bottom, rows_of(steps[index].counters, steps[-1].counters))
    width = free.right - left - drawing.pixels(GAP + 2 * drawing.MARGIN)
    lines = wrap(heading(steps, index), width) + ([note] if note else [])
    drawing.draw_text_panel(left, bottom + height + drawing.pixels(6.0), lines, SENTENCE_SIZE)


def wrap(text: str, width: float) -> list[str]:
    """Lines that are no wider, in pixels, as far as words allow."""
    whole = drawing.text_size(text, SENTENCE_SIZE)[0]
    if whole <= width:
        return [text]
    return textwrap.wrap(text, max(12, int(len(text) * width / whole)))


def _draw_rows(left: float, bottom: float, rows: Sequence[Row]) -> float:
    """Returns how high they are."""
    step, margin = drawing.text_size("")[1], drawing.pixels(drawing.MARGIN)
    swatch, column = drawing.pixels(SWATCH), drawing.pixels(COLUMN)
    width, height = column + drawing.pixels(COUNT_WIDTH) + 2 * margin, len(rows) * step + 2 * margin
    drawing.draw_panel(left, bottom, width, height)
    color = drawing.panel_text_color()
    for number, row in enumerate(reversed(rows)):
        base = bottom + margin + number * step + 0.2 * step
        if row.color is not None:
            drawing.draw_rect(left + margin, base - 0.05 * step, swatch, swatch, row.color, drawing.pixels(2.0))
        drawing.draw_text(left + margin + 1.8 * swatch, base, row.name, color=color)
        right = left + width - margin - drawing.text_size(row.count)[0]
        drawing.draw_text(right, base, row.count, color=color)
    return height
