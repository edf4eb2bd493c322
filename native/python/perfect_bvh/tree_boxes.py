"""The boxes of a tree, as columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import check_count, check_id

_LAST_LEVEL = 0xFFFFFFFF
_COLUMNS = ("boxes", "levels", "leaf_sizes", "costs", "overlaps")


@dataclass(frozen=True, slots=True)
class TreeBoxes:
    """What `Snapshot.tree_boxes` lists: one row a box, from the root downwards, a level after the other.

    boxes: (N, 2, 3) float64, lower and upper corners, in the object space of the mesh; of the top level in world space.
    levels: (N,) int32, 0 for the root.
    leaf_sizes: (N,) int32: the triangles of a leaf, 1 for an instance in the top level, 0 for an interior node.
    costs: (N,) float32: what a random ray through the root's box spends on this box, one for a visited node and one for
        each tested triangle or instance (MacDonald and Booth 1990). Over a whole tree they add up to its SAH.
    overlaps: (N,) float32: the surface area that the box shares with its siblings, as a share of its own; 0 is
        best, and more than 1 is possible where several siblings cover it.
    depth: the deepest level of the whole tree, whichever were listed.
    """

    boxes: npt.NDArray[np.float64]
    levels: npt.NDArray[np.int32]
    leaf_sizes: npt.NDArray[np.int32]
    costs: npt.NDArray[np.float32]
    overlaps: npt.NDArray[np.float32]
    depth: int

    def __len__(self) -> int:
        return len(self.levels)

    def head(self, count: int) -> TreeBoxes:
        """The first `count` boxes: those nearest to the root."""
        columns = {name: getattr(self, name)[:count] for name in _COLUMNS}
        return TreeBoxes(**columns, depth=self.depth)


def list_tree_boxes(
    snapshot: _core.Snapshot, mesh_id: int | None, first_level: int, last_level: int | None
) -> TreeBoxes:
    """See `Snapshot.tree_boxes`."""
    first = check_count("tree_boxes", "first_level", first_level, 0, _LAST_LEVEL)
    last = _LAST_LEVEL if last_level is None else check_count("tree_boxes", "last_level", last_level, 0, _LAST_LEVEL)
    if last < first:
        raise ValueError(
            f"tree_boxes: levels must be 0 <= first_level <= last_level, got {first_level} and {last_level}"
        )
    mesh = None if mesh_id is None else check_id("tree_boxes", "mesh", mesh_id)
    return TreeBoxes(**_core.tree_boxes(snapshot, mesh, min(first, _LAST_LEVEL), min(last, _LAST_LEVEL)))
