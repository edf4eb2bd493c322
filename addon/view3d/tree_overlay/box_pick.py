"""Which of many boxes is under the mouse. Knows no Blender."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from perfect_bvh import TreeBoxes

Float64Array = npt.NDArray[np.float64]


class BoxPicker:
    """Some rows of a list of boxes, ready to be asked by ray after ray."""

    def __init__(self, boxes: TreeBoxes, rows: npt.NDArray[np.intp]) -> None:
        self._rows = rows
        # An axis after the other, each of them in one piece of memory.
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
    """Of boxes with all levels to one, those of this level and the leaves above, none of which holds another."""
    return np.flatnonzero((boxes.levels == level) | (boxes.leaf_sizes > 0))
