"""The path of one ray through the trees, as columns."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from . import _core
from ._checks import check_count, check_id
from .calibration import Calibration, current_calibration


class WalkEvent(IntEnum):
    """An event of a box or a triangle on a ray's path."""

    ENTER_NODE = 0
    """The ray visits a node; the boxes of its children are tested next."""
    ENTER_LEAF = 1
    """It visits a leaf, whose triangles are tested next."""
    ENTER_INSTANCE = 2
    """It continues in the tree of an instance, transformed by the inverse of the instance's matrix."""
    SKIP_INSTANCE = 3
    """It reaches an instance whose mask shares no bit with its own, or that it passes by."""
    BOX_HIT = 4
    """A box is tested and hit: it will be visited later, unless a nearer hit is found first."""
    BOX_MISSED = 5
    """A box is tested; the ray passes by, or its range ends before."""
    BOX_PRUNED = 6
    """A box is tested, and begins behind the nearest hit so far."""
    WAITING_PRUNED = 7
    """A box in the queue is skipped: it begins behind a hit that was found after the box's test."""
    TRIANGLE_MISSED = 8
    """A triangle is tested; the ray passes by."""
    TRIANGLE_HIT = 9
    """A triangle is tested: the nearest hit so far."""
    TRIANGLE_REJECTED = 10
    """A triangle is hit, but behind the nearest hit, out of the ray's range or from the culled side."""


VISITS = (WalkEvent.ENTER_NODE, WalkEvent.ENTER_INSTANCE, WalkEvent.SKIP_INSTANCE)
BOX_TESTS = (WalkEvent.BOX_HIT, WalkEvent.BOX_MISSED, WalkEvent.BOX_PRUNED)
TRIANGLE_TESTS = (WalkEvent.TRIANGLE_MISSED, WalkEvent.TRIANGLE_HIT, WalkEvent.TRIANGLE_REJECTED)


@dataclass(frozen=True, slots=True)
class RayWalk:
    """The result of `walk_ray`: one row for each event, in order.

    Attributes:
        events: (N,) uint8, numbers of `WalkEvent`.
        bounds: (N, 2, 3) float64, lower and upper corners of the box, in the object space of its mesh; of the top level
            in world space. For triangles the box of their leaf.
        transforms: (N, 3, 4) float64: the map from the space of `bounds` to the world.
        triangles: (N, 3, 3) float64, corners in the world; NaN for events of boxes.
        t: (N,) float64: where the ray enters the box, a little early by design, or hits the triangle; inf where it
            does neither. For a tree's root it is the ray's t_min if the ray begins inside.
        nearest_t: (N,) float64: t of the nearest hit after the event, inf before the first.
        levels: (N,) int32, the level of the box in its tree, 0 for the root. A triangle has its leaf's.
        instance_ids, mesh_ids: (N,) int32: the instance and mesh of the tree, or of the instance that is entered; -1
            for boxes of the top level.
        primitive_ids: (N,) int32: the triangle; -1 for events of boxes.
    """

    events: npt.NDArray[np.uint8]
    bounds: npt.NDArray[np.float64]
    transforms: npt.NDArray[np.float64]
    triangles: npt.NDArray[np.float64]
    t: npt.NDArray[np.float64]
    nearest_t: npt.NDArray[np.float64]
    levels: npt.NDArray[np.int32]
    instance_ids: npt.NDArray[np.int32]
    mesh_ids: npt.NDArray[np.int32]
    primitive_ids: npt.NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.events)

    @property
    def hit_row(self) -> int | None:
        """The row of the hit at which the ray ends, None if it hits nothing."""
        rows = np.flatnonzero(self.events == WalkEvent.TRIANGLE_HIT)
        return int(rows[-1]) if len(rows) else None

    @property
    def nodes_visited(self) -> int:
        """The count of nodes and of instances that were reached, as in `Hits.nodes_visited`."""
        return int(np.isin(self.events, VISITS).sum())

    @property
    def primitives_tested(self) -> int:
        """The count of triangle tests, with repetitions, as in `Hits.primitives_tested`."""
        return int(np.isin(self.events, TRIANGLE_TESTS).sum())

    @property
    def cost(self) -> int:
        """The cost in the units of `TreeBoxes.costs`: one for each visited node or instance and tested triangle."""
        return self.nodes_visited + self.primitives_tested

    def nanoseconds(self, calibration: Calibration | None = None) -> npt.NDArray[np.float64]:
        """(N,) float64: the cost of each event for one thread, as the governor estimates it; the sum is the ray's cost.

        Args:
            calibration: The cost of visits; None for this machine's, as scenes have it. Boxes that are tested together
                share the visit of their node, triangles that of their leaf. Reaching an instance costs as much as a
                node.
        """
        costs = current_calibration() if calibration is None else calibration
        visits = np.zeros(len(WalkEvent))
        visits[list(VISITS)] = costs.node_nanoseconds
        visits[WalkEvent.ENTER_LEAF] = costs.leaf_nanoseconds
        found = visits[self.events]
        is_visit = np.isin(self.events, (WalkEvent.ENTER_NODE, WalkEvent.ENTER_LEAF))
        tests = np.flatnonzero(np.isin(self.events, BOX_TESTS + TRIANGLE_TESTS))
        visited = np.maximum.accumulate(np.where(is_visit, np.arange(len(self)), 0))[tests]
        found[tests] = found[visited] / np.bincount(visited, minlength=len(self))[visited]
        found[visited] = 0.0
        return found

    def world_boxes(self) -> npt.NDArray[np.float64]:
        """(N, 8, 3) float64: the corners of each box in the world.

        Corner i has the upper bound on axis a if bit a of i is set.
        """
        upper = (np.arange(8)[:, None] >> np.arange(3)) & 1
        corners = np.where(upper[None], self.bounds[:, None, 1], self.bounds[:, None, 0])
        rotations, places = self.transforms[:, None, :, :3], self.transforms[:, None, :, 3]
        return (rotations @ corners[..., None])[..., 0] + places


# Tree boxes ----------------------------------------------------------------------------------------------------------
# The boxes of a tree, as columns.


_LAST_LEVEL = 0xFFFFFFFF
_COLUMNS = ("boxes", "levels", "leaf_sizes", "costs", "subtree_costs", "overlaps", "ranges")


@dataclass(frozen=True, slots=True)
class TreeBoxes:
    """The result of `Snapshot.tree_boxes`: one row for each box, level by level from the root down.

    These describe the whole tree, for any range of listed levels:
    primitives: (M,) int32: the triangles of the mesh, or the ids of the instances, leaf after leaf. Triangles that
        spatial splits have cut are in several leaves.
    depth: the deepest level.
    sah: the sum of all costs. built_sah: the same when the tree was built; equal to `sah` if it was not refitted since.

    Attributes:
        boxes: (N, 2, 3) float64, lower and upper corners, in the object space of the mesh; of the top level in world
            space.
        levels: (N,) int32, 0 for the root.
        leaf_sizes: (N,) int32: the triangles of a leaf, 1 for an instance in the top level, 0 for an interior node.
        costs: (N,) float32: the expected cost of this box for a random ray through the root's box, one for a visited
            node and one for each tested triangle or instance (MacDonald and Booth 1990). The sum over a tree is its
            SAH.
        subtree_costs: (N,) float32: the expected cost of this box and all below it.
        overlaps: (N,) float32: the surface area that the box shares with its siblings, divided by its area. 0 is
            best, and more than 1 is possible where several siblings cover it.
        ranges: (N, 2) int64: the rows of `primitives` that the box holds, begin and end (exclusive).
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
        """(N,) float32: the probability that a random ray through the root box hits each: its area over the root's."""
        return np.divide(self.costs, np.maximum(self.leaf_sizes, 1), dtype=np.float32)

    def primitives_of(self, row: int) -> npt.NDArray[np.int32]:
        """Returns (K,) int32: the triangles, or the ids of the instances, in one of the boxes."""
        begin, end = self.ranges[row]
        return self.primitives[begin:end]

    def head(self, count: int) -> TreeBoxes:
        """Returns the first `count` boxes: those nearest to the root."""
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
