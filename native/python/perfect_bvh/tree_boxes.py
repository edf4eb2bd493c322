"""The boxes of a tree, as columns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import check_count, check_id

_LAST_LEVEL = 0xFFFFFFFF
_COLUMNS = ("boxes", "levels", "leaf_sizes", "costs", "subtree_costs", "overlaps", "ranges")


@dataclass(frozen=True, slots=True)
class TreeBoxes:
    """What `Snapshot.tree_boxes` lists: one row a box, from the root downwards, a level after the other.

    boxes: (N, 2, 3) float64, lower and upper corners, in the object space of the mesh; of the top level in world space.
    levels: (N,) int32, 0 for the root.
    leaf_sizes: (N,) int32: the triangles of a leaf, 1 for an instance in the top level, 0 for an interior node.
    costs: (N,) float32: what a random ray through the root's box spends on this box, one for a visited node and one for
        each tested triangle or instance (MacDonald and Booth 1990). Over a whole tree they add up to its SAH.
    subtree_costs: (N,) float32: what it spends on this box and on all below it.
    overlaps: (N,) float32: the surface area that the box shares with its siblings, as a share of its own; 0 is
        best, and more than 1 is possible where several siblings cover it.
    ranges: (N, 2) int64: the rows of `primitives` that the box holds, from the first to before the second.

    Of the whole tree, whichever levels were listed:
    primitives: (M,) int32: the triangles of the mesh, or the ids of the instances, leaf after leaf. Where spatial
        splits have cut triangles, these stand in several leaves.
    depth: the deepest level.
    sah: all costs together. built_sah: the same when the tree was built; `sah` where it was not refitted since.
    """

    boxes: npt.NDArray[np.float64]
    levels: npt.NDArray[np.int32]
    leaf_sizes: npt.NDArray[np.int32]
    costs: npt.NDArray[np.float32]
    subtree_costs: npt.NDArray[np.float32]
    overlaps: npt.NDArray[np.float32]
    ranges: npt.NDArray[np.int64]
    primitives: npt.NDArray[np.int32]
    depth: int
    sah: float
    built_sah: float

    def __len__(self) -> int:
        return len(self.levels)

    @property
    def hit_chances(self) -> npt.NDArray[np.float32]:
        """(N,) float32: how likely a random ray that meets the root's box meets each: its area over the root's."""
        return np.divide(self.costs, np.maximum(self.leaf_sizes, 1), dtype=np.float32)

    def primitives_of(self, row: int) -> npt.NDArray[np.int32]:
        """(K,) int32: the triangles, or the ids of the instances, that one of the boxes holds."""
        begin, end = self.ranges[row]
        return self.primitives[begin:end]

    def head(self, count: int) -> TreeBoxes:
        """The first `count` boxes: those nearest to the root."""
        return replace(self, **{name: getattr(self, name)[:count] for name in _COLUMNS})


def list_tree_boxes(
    snapshot: _core.Snapshot, mesh_id: int | None, first_level: int, last_level: int | None, with_leaves_above: bool
) -> TreeBoxes:
    """See `Snapshot.tree_boxes`."""
    first = check_count("tree_boxes", "first_level", first_level, 0, _LAST_LEVEL)
    last = _LAST_LEVEL if last_level is None else check_count("tree_boxes", "last_level", last_level, 0, _LAST_LEVEL)
    if last < first:
        raise ValueError(
            f"tree_boxes: levels must be 0 <= first_level <= last_level, got {first_level} and {last_level}"
        )
    mesh = None if mesh_id is None else check_id("tree_boxes", "mesh", mesh_id)
    return TreeBoxes(**_core.tree_boxes(snapshot, mesh, first, last, bool(with_leaves_above)))
