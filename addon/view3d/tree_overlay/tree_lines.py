"""The lines of one tree's boxes, kept on the graphics card until the boxes or their colours are others."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..box_lines import MOST_BOXES, BoxLines, box_lines
from ..color_scale import Scale
from .box_pick import BoxPicker, rows_of_cut
from .box_words import Shown, scale_of

if TYPE_CHECKING:
    import bpy
    import gpu
    from perfect_bvh import Snapshot, TreeBoxes

# Of boxes that are about to be others: as RGBA.
GREY = (0.5, 0.5, 0.5, 0.4)
COLUMNS = ("boxes", "levels", "costs", "overlaps", "ranges", "primitives")


class TreeLines:
    """The lines of one tree, made again only where its boxes or their colours are others.

    shown: what is drawn, in numbers. scale: what its colours mean. boxes: those of it; None before there are any.
    number: of the change that led to them. levels: of those that are drawn.
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
    import gpu

    layout = gpu.types.GPUVertFormat()
    position = layout.attr_add(id="pos", comp_type="F32", len=3, fetch_mode="FLOAT")
    color = layout.attr_add(id="color", comp_type="F32", len=4, fetch_mode="FLOAT")
    vertices = gpu.types.GPUVertBuf(layout, len(lines.positions))
    vertices.attr_fill(position, lines.positions)
    vertices.attr_fill(color, lines.colors)
    return gpu.types.GPUBatch(type="LINES", buf=vertices, elem=gpu.types.GPUIndexBuf(type="LINES", seq=lines.lines))
