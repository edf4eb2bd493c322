"""Committed states of a scene."""

from __future__ import annotations

from . import _core
from ._arrays import check_id
from .queries import Queries
from .tree_boxes import TreeBoxes, list_tree_boxes


class Snapshot(Queries):
    """An immutable committed scene. Any number of threads may query it while its scene is edited.

    Get one from `Scene.snapshot()`; `Scene` has the same queries, for the snapshot of the moment.
    """

    __slots__ = ("_snapshot",)

    def __init__(self, core_snapshot: _core.Snapshot) -> None:
        self._snapshot = core_snapshot

    def _committed(self) -> _core.Snapshot:
        return self._snapshot

    @property
    def generation(self) -> int:
        """Counts the scene's commits from 1."""
        return self._snapshot.generation

    @property
    def scene_id(self) -> int:
        """Which `Scene` of this process it came from."""
        return self._snapshot.scene_id

    def tree_boxes(
        self,
        mesh: int | None = None,
        *,
        first_level: int = 0,
        last_level: int | None = None,
        with_leaves_above: bool = False,
    ) -> TreeBoxes:
        """The boxes that rays meet on their way down one tree, for drawing it or judging it.

        mesh: the id of a mesh, for its tree; None for the top level, over the instances.
        first_level, last_level: which levels, both included; the root is level 0, and None is the deepest. A node has
            up to eight children, so that each level may hold eight times as many boxes as the one above.
        with_leaves_above: also the leaves that stand above the first level. One level with them is a cut through the
            tree: its boxes together hold all that the tree holds.

        Raises ValueError for a mesh that this snapshot does not have, and for levels out of order.
        """
        return list_tree_boxes(self._snapshot, mesh, first_level, last_level, with_leaves_above)

    def tree_sah(self, mesh: int) -> float:
        """What a random ray that meets the box of a mesh's tree spends there: float, the `sah` of its `tree_boxes`.

        One for a visited node and one for each tested triangle (MacDonald and Booth 1990), summed in another order than
        there: the last digits may differ. The tree is gone through once, and nothing is copied.

        Raises ValueError for a mesh that this snapshot does not have.
        """
        return _core.tree_sah(self._snapshot, check_id("tree_sah", "mesh", mesh))
