"""What is drawn of a tree, and what one of its boxes is, as lines of text. Knows no Blender."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..box_lines import COST_DECADES
from ..color_scale import Scale

if TYPE_CHECKING:
    from perfect_bvh import TreeBoxes

# More would not fit into a legend side by side.
MOST_SWATCHES = 16


@dataclass(frozen=True, slots=True)
class Shown:
    """What is drawn of a tree.

    level: the one that was asked for, or the deepest that there is; first_level: 0 if all above are drawn, too.
    count: boxes drawn; total: of those levels, more than count where not all are drawn. depth: of the whole tree.
    sah, built_sah: what a random ray spends in the tree as it is, and as it was when it was built.
    """

    level: int
    first_level: int
    count: int
    total: int
    depth: int
    sah: float
    built_sah: float


def describe(shown: Shown) -> str:
    """The line below the name of a tree."""
    if not shown.total:
        return "No boxes"
    level = f"Level {shown.level}" if shown.first_level == shown.level else f"Levels 0 to {shown.level}"
    boxes = f"{shown.count:,}" if shown.count == shown.total else f"{shown.count:,} of {shown.total:,}"
    noun = "box" if shown.total == 1 else "boxes"
    sah, built = format_cost(shown.sah), format_cost(shown.built_sah)
    since = "" if sah == built else f" (built: {built})"
    return f"{level} of {shown.depth} - {boxes} {noun} - SAH {sah}{since}"


def describe_box(boxes: TreeBoxes, row: int, *, holds: str, name: str = "") -> list[str]:
    """What one box is. holds: what stands in leaves, such as "triangle" or "instance". name: of the only one."""
    size, level = int(boxes.leaf_sizes[row]), int(boxes.levels[row])
    begin, end = boxes.ranges[row]
    chance, own, whole = (float(column[row]) for column in (boxes.hit_chances, boxes.costs, boxes.subtree_costs))
    count = f"{end - begin:,} {holds}{'' if end - begin == 1 else 's'}"
    lines = [f"{'Leaf' if size else 'Node'} on level {level}: {name or count}"]
    lines.append(f"Chance of being hit: {format_share(chance)}")
    if size:
        lines.append(f"Cost: {format_cost(own)}")
    else:
        lines.append(f"Cost: {format_cost(own)}, with all below {format_cost(whole)} of {format_cost(boxes.sah)}")
    return lines


def format_cost(cost: float) -> str:
    """Three digits of a number of visits and tests, two of one below 1."""
    if cost >= 1000.0 or cost <= 0.0:
        return f"{cost:,.0f}"
    if cost >= 1.0:
        return f"{cost:.1f}" if cost >= 10.0 else f"{cost:.2f}"
    decimals = 1 - math.floor(math.log10(cost))
    return f"{cost:.{decimals}f}".rstrip("0")


def format_share(share: float) -> str:
    """As a percentage of two digits at least."""
    percent = 100.0 * share
    if percent >= 10.0 or percent == 0.0:
        return f"{percent:.0f}%"
    return f"{percent:.1f}%" if percent >= 1.0 else f"{percent:.2g}%" if percent >= 0.01 else "less than 0.01%"


# Scales --------------------------------------------------------------------------------------------------------------


def scale_of(boxes: TreeBoxes, color_by: str) -> Scale:
    """Of boxes as `box_lines.shares` colours them. color_by: "LEVEL", "OVERLAP" or "COST"."""
    if color_by == "OVERLAP":
        return Scale("Overlap with siblings", ((0.0, "0%"), (0.5, "50%"), (1.0, "100%")))
    if color_by == "COST":
        dearest = float(boxes.costs.max(initial=0.0))
        if not dearest > 0.0:
            return Scale("Cost of a box", ((0.0, "0"),))
        places = np.linspace(0.0, 1.0, int(COST_DECADES) // 2 + 1)
        labels = [format_cost(dearest * 10.0 ** (COST_DECADES * (place - 1.0))) for place in places]
        labels[0] = f"\N{LESS-THAN OR EQUAL TO} {labels[0]}"
        return Scale("Cost of a box", tuple(zip(places.tolist(), labels, strict=True)))
    if boxes.depth < MOST_SWATCHES:
        places = np.arange(boxes.depth + 1) / max(boxes.depth, 1)
        labels = [str(level) for level in range(boxes.depth + 1)]
        return Scale("Level", tuple(zip(places.tolist(), labels, strict=True)), levels=boxes.depth + 1)
    return Scale("Level", ((0.0, "0"), (0.5, f"{boxes.depth / 2:g}"), (1.0, str(boxes.depth))))
