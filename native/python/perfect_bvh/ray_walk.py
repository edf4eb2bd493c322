"""What one ray does on its way through the trees, as columns."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from .calibration import Calibration, current_calibration


class WalkEvent(IntEnum):
    """What happens to a box or a triangle on a ray's way."""

    ENTER_NODE = 0
    """The ray visits a node; the boxes of its children are tested next."""
    ENTER_LEAF = 1
    """It visits a leaf, whose triangles are tested next."""
    ENTER_INSTANCE = 2
    """It goes on in the tree of an instance, transformed by the inverse of the instance's matrix."""
    SKIP_INSTANCE = 3
    """It reaches an instance whose mask shares no bit with its own, or that it passes by."""
    BOX_HIT = 4
    """A box is tested and hit: it is visited later, unless a hit is found before its turn."""
    BOX_MISSED = 5
    """A box is tested; the ray passes by, or its range ends before."""
    BOX_PRUNED = 6
    """A box is tested, and begins behind the nearest hit so far."""
    WAITING_PRUNED = 7
    """A box that was to be visited begins behind the hit that has been found meanwhile."""
    TRIANGLE_MISSED = 8
    """A triangle is tested; the ray passes by."""
    TRIANGLE_HIT = 9
    """A triangle is tested: the nearest hit so far."""
    TRIANGLE_REJECTED = 10
    """A triangle is tested and met: behind the nearest hit, out of the ray's range or from the side that is culled."""


VISITS = (WalkEvent.ENTER_NODE, WalkEvent.ENTER_INSTANCE, WalkEvent.SKIP_INSTANCE)
BOX_TESTS = (WalkEvent.BOX_HIT, WalkEvent.BOX_MISSED, WalkEvent.BOX_PRUNED)
TRIANGLE_TESTS = (WalkEvent.TRIANGLE_MISSED, WalkEvent.TRIANGLE_HIT, WalkEvent.TRIANGLE_REJECTED)


@dataclass(frozen=True, slots=True)
class RayWalk:
    """What `walk_ray` saw: one row an event, in the order in which they happen.

    events: (N,) uint8, numbers of `WalkEvent`.
    bounds: (N, 2, 3) float64, lower and upper corners of the box, in the object space of its mesh; of the top level in
        world space. For triangles the box of their leaf.
    transforms: (N, 3, 4) float64: the map from the space of `bounds` to the world.
    triangles: (N, 3, 3) float64, corners in the world; NaN where the event is a box's.
    t: (N,) float64: where the ray enters the box, a little early by design, or meets the triangle; inf where it does
        not. Of a tree's root also where the ray begins inside: its t_min.
    nearest_t: (N,) float64: t of the nearest hit after the event, inf before the first.
    levels: (N,) int32, of the box in its tree, 0 for the root. A triangle has its leaf's.
    instance_ids, mesh_ids: (N,) int32: whose tree it is, or which instance is entered; -1 for boxes of the top level.
    primitive_ids: (N,) int32: the triangle; -1 where the event is a box's.
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
        """The row of the hit that the ray ends at, None if it hits nothing."""
        rows = np.flatnonzero(self.events == WalkEvent.TRIANGLE_HIT)
        return int(rows[-1]) if len(rows) else None

    @property
    def nodes_visited(self) -> int:
        """As `Hits.nodes_visited` counts: nodes, and instances that were reached."""
        return int(np.isin(self.events, VISITS).sum())

    @property
    def primitives_tested(self) -> int:
        """As `Hits.primitives_tested` counts: triangles, as often as they were tested."""
        return int(np.isin(self.events, TRIANGLE_TESTS).sum())

    @property
    def cost(self) -> int:
        """In the units of `TreeBoxes.costs`: one for each visited node or instance and each tested triangle."""
        return self.nodes_visited + self.primitives_tested

    def nanoseconds(self, calibration: Calibration | None = None) -> npt.NDArray[np.float64]:
        """(N,) float64: what each event costs one thread, as the governor reckons; together, what the ray costs.

        calibration: what visits cost; None for this machine's, as scenes have it. Boxes that are tested at once share
        the visit of their node, triangles that of their leaf. An instance that is reached costs what a node does.
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
