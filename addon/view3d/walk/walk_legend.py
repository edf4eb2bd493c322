"""The text over a viewport of a ray's walk: the current event, the meaning of colors, each count and its cost."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
from perfect_bvh import WalkEvent
from perfect_bvh.ray_walk import BOX_TESTS, TRIANGLE_TESTS

from ...statistics.words import count_of
from .. import drawing
from ..legend import hud_top

if TYPE_CHECKING:
    from .walk_steps import Counters

Color = tuple[float, float, float]

SENTENCE_SIZE = 13.0
SWATCH = 9.0  # in points
# In points: of names, of counts, and of costs, the latter two with their right ends below one another.
NAME_WIDTH, COUNT_WIDTH, COST_WIDTH = 166.0, 32.0, 104.0
GAP = 14.0
LEAST_LINE = 12  # characters
SHADE = 0.85  # of rows that are parts of the row above
SHARE = 0.5  # of the free height, at most: the ray must stay visible, too
_INSTANCES = (WalkEvent.ENTER_INSTANCE, WalkEvent.SKIP_INSTANCE)
_NOT_HIT = (WalkEvent.TRIANGLE_MISSED, WalkEvent.TRIANGLE_REJECTED)


@dataclass(frozen=True, slots=True)
class Row:
    """color: None for rows without a color in the picture. cost: "" for rows without a separate time.

    is_part: whether it is a part of a row above.
    """

    name: str
    count: str
    color: Color | None = None
    cost: str = ""
    is_part: bool = False


def rows_of(counters: Counters, total: Counters, tested: str = "Triangles") -> list[Row]:
    """counters: with the step that is shown. total: with all of them. tested: what leaves hold, such as "Segments".

    Costs of boxes, triangles and instances add up to the total, those of the parts to that of the row above them.
    """
    from . import walk_picture as picture

    def whole(name: str, count: int, *events: WalkEvent) -> Row:
        return Row(name, f"{count:,}", cost=f"{counters.time(*events):,} ns")

    def part(name: str, count: int, color: Color, *events: WalkEvent) -> Row:
        return Row(name, f"{count:,}", color, f"{counters.time(*events):,} ns" if events else "", is_part=True)

    nodes, leaves = counters.number(WalkEvent.ENTER_NODE), counters.number(WalkEvent.ENTER_LEAF)
    in_nodes, in_leaves = count_of(nodes, "Node"), count_of(leaves, "Leaf", "Leaves")
    other = counters.triangles_tested - counters.triangles_hit
    return [
        whole(f"Boxes Tested in {in_nodes}", counters.boxes_tested, *BOX_TESTS),
        part("Hit", counters.boxes_hit, picture.WAITING, WalkEvent.BOX_HIT),
        part("Missed", counters.boxes_missed, picture.MISSED, WalkEvent.BOX_MISSED),
        part("Pruned: Behind a Hit", counters.boxes_pruned, picture.PRUNED, WalkEvent.BOX_PRUNED),
        part("Entered", counters.boxes_entered, picture.ENTERED),
        whole(f"{tested} Tested in {in_leaves}", counters.triangles_tested, *TRIANGLE_TESTS),
        part("Hit", counters.triangles_hit, picture.HIT, WalkEvent.TRIANGLE_HIT),
        part("Not Hit", other, picture.TESTED, *_NOT_HIT),
        whole("Instances Reached", counters.number(*_INSTANCES), *_INSTANCES),
        Row("Total", "", cost=f"{counters.total_time:,} of {total.total_time:,} ns"),
        Row(f"SAH Cost: Visits + {tested}", f"{counters.cost:,} of {total.cost:,}"),
    ]


def draw_legend(context: bpy.types.Context, sentence: str, rows: Sequence[Row]) -> None:
    """Draws in the lower left corner of the region that is being drawn.

    If there is little room, it leaves out the parts of rows; if there is less, it draws only the sentence.
    """
    free = drawing.free_rect(context.area, context.region)
    left = free.left + drawing.pixels(GAP)
    bottom = max(free.bottom, hud_top(context.area, context.region)) + drawing.pixels(GAP)
    width = free.right - left - drawing.pixels(GAP + 2 * drawing.MARGIN)
    lines = wrap(sentence, width)
    gap, words = drawing.pixels(6.0), drawing.text_panel_size(lines, SENTENCE_SIZE)[1]
    for shown in (rows, [row for row in rows if not row.is_part]):
        size = _size_of(shown)
        has_room = size[1] <= SHARE * (free.top - free.bottom) and bottom + size[1] + gap + words <= free.top
        if shown and has_room and left + size[0] <= free.right:
            _draw_rows(left, bottom, size, shown)
            bottom += size[1] + gap
            break
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
    """Returns the size, with a line above for the titles of the columns."""
    margin = 2 * drawing.pixels(drawing.MARGIN)
    width = drawing.pixels(NAME_WIDTH + COUNT_WIDTH + COST_WIDTH)
    return width + margin, (len(rows) + 1) * drawing.text_size("")[1] + margin


def _draw_rows(left: float, bottom: float, size: tuple[float, float], rows: Sequence[Row]) -> None:
    step, margin = drawing.text_size("")[1], drawing.pixels(drawing.MARGIN)
    drawing.draw_panel(left, bottom, *size)
    left, right = left + margin, left + size[0] - margin
    shown = [Row("", "Count", cost="Estimated Time", is_part=True), *rows]
    for number, row in enumerate(reversed(shown)):
        _draw_row(row, left, right, bottom + margin + number * step + 0.2 * step)


def _draw_row(row: Row, left: float, right: float, base: float) -> None:
    indent, swatch, edge = (drawing.pixels(points) for points in (1.8 * SWATCH, SWATCH, 1.0))
    text = drawing.panel_text_color()
    color = (*text[:3], SHADE) if row.is_part else text
    if row.color is not None:
        y = base - drawing.pixels(0.8)
        outline = (*text[:3], 0.5)  # of what would be too like the panel
        drawing.draw_rect(left - edge, y - edge, swatch + 2 * edge, swatch + 2 * edge, outline, drawing.pixels(3.0))
        drawing.draw_rect(left, y, swatch, swatch, row.color, drawing.pixels(2.0))
    drawing.draw_text(left + (indent if row.is_part else 0.0), base, row.name, color=color)
    count_end = right - (drawing.pixels(COST_WIDTH) if row.is_part or row.cost else 0.0)
    for end, written in ((count_end, row.count), (right, row.cost)):
        drawing.draw_text(end - drawing.text_size(written)[0], base, written, color=color)
