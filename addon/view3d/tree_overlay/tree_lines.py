"""The lines of one tree's boxes, kept on the graphics card until the boxes or their colours are others."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..drawing import COST_DECADES, MOST_BOXES, BoxLines, box_lines, make_batch
from ..legend import Scale

if TYPE_CHECKING:
    import bpy
    import gpu
    from perfect_bvh import Snapshot, TreeBoxes

# Finds the box under the mouse among many. Does not depend on Blender.


Float64Array = npt.NDArray[np.float64]


class BoxPicker:
    """Some rows of a list of boxes, ready to be asked by ray after ray."""

    def __init__(self, boxes: TreeBoxes, rows: npt.NDArray[np.intp]) -> None:
        self._rows = rows
        # One axis after another, each contiguous in memory.
        self._corners = np.ascontiguousarray(boxes.boxes[rows].transpose(1, 2, 0))

    def nearest(self, origin: Float64Array, direction: Float64Array) -> int | None:
        """The row of the box that a ray enters first, None if it meets none.

        origin, direction: (3,) in the space of the boxes. A box around the origin is entered where the ray leaves it:
        of those that the eye is in, the smallest, and none of them as long as there are others before the eye.
        """
        enter = np.full(len(self._rows), -np.inf)
        leave = np.full(len(self._rows), np.inf)
        with np.errstate(divide="ignore", invalid="ignore"):
            for axis in range(3):
                near, far = (self._corners[:, axis] - origin[axis]) / direction[axis]
                # A ray along a face divides nothing by nothing: it is in that slab, as fmin and fmax have it.
                np.fmax(enter, np.minimum(near, far), out=enter)
                np.fmin(leave, np.maximum(near, far), out=leave)
        met = np.flatnonzero((enter <= leave) & (leave >= 0.0))
        if not len(met):
            return None
        is_before = enter[met] > 0.0
        nearest = np.lexsort((np.where(is_before, enter[met], leave[met]), ~is_before))[0]
        return int(self._rows[met[nearest]])


def rows_of_cut(boxes: TreeBoxes, level: int) -> npt.NDArray[np.intp]:
    """Returns, of boxes down to one level, the rows of that level and of the leaves above; none contains another."""
    return np.flatnonzero((boxes.levels == level) | (boxes.leaf_sizes > 0))


# Box words -----------------------------------------------------------------------------------------------------------
# Describes the drawing of a tree, and one of its boxes, as lines of text. Does not depend on Blender.


# More would not fit into a legend side by side.
MOST_SWATCHES = 16


@dataclass(frozen=True, slots=True)
class Shown:
    """The drawn part of a tree.

    level: the requested one, or the deepest one; first_level: 0 if all above are drawn, too.
    count: boxes drawn; total: of those levels, more than count if not all are drawn. depth: of the whole tree.
    sah, built_sah: the expected cost of a random ray in the tree now, and when it was built.
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
    """Describe one box. holds: the contents of leaves, such as "triangle" or "instance". name: of the only one."""
    size, level = int(boxes.leaf_sizes[row]), int(boxes.levels[row])
    begin, end = boxes.ranges[row]
    chance, own, whole = (float(column[row]) for column in (boxes.hit_chances, boxes.costs, boxes.subtree_costs))
    count = f"{end - begin:,} {holds}{'' if end - begin == 1 else 's'}"
    lines = [f"{'Leaf' if size else 'Node'} on level {level}: {name or count}"]
    lines.append(f"Chance of being hit: {format_share(chance)}")
    lines.append(f"Expected nodes and {holds}s of a ray: {format_cost(own)}")
    if not size:
        lines.append(f"With all below: {format_cost(whole)}, in the whole BVH: {format_cost(boxes.sah)} (SAH)")
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
    """Formats a percentage with two digits at least."""
    percent = 100.0 * share
    if percent >= 10.0 or percent == 0.0:
        return f"{percent:.0f}%"
    return f"{percent:.1f}%" if percent >= 1.0 else f"{percent:.2g}%" if percent >= 0.01 else "less than 0.01%"


# Scales --------------------------------------------------------------------------------------------------------------


def scale_of(boxes: TreeBoxes, color_by: str) -> Scale:
    """Returns the scale of boxes as `box_lines.shares` colours them. color_by: "LEVEL", "OVERLAP" or "COST"."""
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


# Tree lines ----------------------------------------------------------------------------------------------------------


# Of boxes that are about to be others: as RGBA.
GREY = (0.5, 0.5, 0.5, 0.4)
COLUMNS = ("boxes", "levels", "costs", "overlaps", "ranges", "primitives")


class TreeLines:
    """The lines of one tree, made again only if its boxes or their colours change.

    shown: the drawn part, in numbers. scale: the meaning of its colours. boxes: the tree's; None before there are any.
    number: of the change that led to them. levels: of the drawn boxes.
    """

    def __init__(self) -> None:
        self.shown: Shown | None = None
        self.scale: Scale | None = None
        self.boxes: TreeBoxes | None = None
        self.number = 0
        self.levels: frozenset[int] = frozenset()
        self._asked: tuple[Any, ...] = ()
        self._lines: BoxLines | None = None
        self._picker: BoxPicker | None = None
        self._batch: gpu.types.GPUBatch | None = None
        self._grey_batch: gpu.types.GPUBatch | None = None

    def follow(self, snapshot: Snapshot, mesh: int | None, settings: bpy.types.PropertyGroup) -> None:
        """Make the lines those of a tree (None: the top level) as a snapshot has it, if they are not."""
        choice = (settings.level, settings.use_all_to_level, settings.color_by)
        asked = (snapshot.scene_id, snapshot.generation, mesh, *choice)
        if asked == self._asked:
            return
        boxes, level = list_levels(snapshot, mesh, settings.level, settings.use_all_to_level)
        had_same_colors = self._asked[3:] == choice
        self._asked = asked
        if had_same_colors and self.boxes is not None and are_equal(boxes, self.boxes):
            return
        first = 0 if settings.use_all_to_level else level
        drawn = boxes.head(MOST_BOXES)
        self.boxes, self.number, self._picker = boxes, self.number + 1, None
        self.shown = Shown(level, first, len(drawn), len(boxes), boxes.depth, boxes.sah, boxes.built_sah)
        self.levels = frozenset(np.unique(drawn.levels).tolist())
        self.scale = scale_of(drawn, settings.color_by)
        self._lines = box_lines(drawn, settings.color_by) if len(boxes) else None
        self._batch = None if self._lines is None else _make_batch(self._lines)
        self._grey_batch = None

    def pick(self, origin: Any, direction: Any) -> int | None:
        """The row of the drawn box that a ray in the boxes' space meets first, of those that hold no other."""
        if self.boxes is None or self.shown is None or not self.shown.count:
            return None
        if self._picker is None:
            drawn = self.boxes.head(self.shown.count)
            self._picker = BoxPicker(drawn, rows_of_cut(drawn, self.shown.level))
        return self._picker.nearest(origin, direction)

    def draw(self, matrix: Any = None, *, in_grey: bool = False) -> None:
        """Draw them in the 3D viewport that is being drawn. matrix: (4, 4) from the boxes' space to the world."""
        if self._batch is None:
            return
        batch = self._in_grey() if in_grey else self._batch
        import gpu
        from mathutils import Matrix

        with gpu.matrix.push_pop():
            if matrix is not None:
                gpu.matrix.multiply_matrix(Matrix(matrix.tolist()))
            batch.draw(gpu.shader.from_builtin("FLAT_COLOR"))

    def _in_grey(self) -> gpu.types.GPUBatch:
        if self._grey_batch is None:
            assert self._lines is not None
            self._grey_batch = _make_batch(replace(self._lines, colors=np.full_like(self._lines.colors, GREY)))
        return self._grey_batch


def list_levels(snapshot: Snapshot, mesh: int | None, level: int, use_all: bool) -> tuple[TreeBoxes, int]:
    """The boxes of a level and the leaves above, or of all to it; and which it is: the deepest of a shallower tree."""
    first = 0 if use_all else level
    boxes = snapshot.tree_boxes(mesh, first_level=first, last_level=level, with_leaves_above=True)
    if level <= boxes.depth:
        return boxes, level
    return list_levels(snapshot, mesh, boxes.depth, use_all)


def are_equal(one: TreeBoxes, other: TreeBoxes) -> bool:
    """Whether two lists tell the same of the same boxes."""
    are_alike = (one.depth, one.sah, one.built_sah) == (other.depth, other.sah, other.built_sah)
    return are_alike and all(np.array_equal(getattr(one, name), getattr(other, name)) for name in COLUMNS)


def _make_batch(lines: BoxLines) -> gpu.types.GPUBatch:
    return make_batch("LINES", lines.lines, pos=lines.positions, color=lines.colors)
