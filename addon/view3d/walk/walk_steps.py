"""What a ray does on its way, as steps with a sentence and counters. Knows no Blender.

A step is what the processor does at a time: a node with the boxes of its children, a leaf with its triangles, an
instance that is entered, waiting boxes that a new hit makes superfluous. The last one says what was hit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from perfect_bvh import WalkEvent
from perfect_bvh.ray_walk import BOX_TESTS, TRIANGLE_TESTS, VISITS

if TYPE_CHECKING:
    from perfect_bvh import RayWalk

    from .walk_words import WalkWords

_BEGINNINGS = (WalkEvent.ENTER_NODE, WalkEvent.ENTER_LEAF, WalkEvent.ENTER_INSTANCE, WalkEvent.SKIP_INSTANCE)
_ENTERED = _BEGINNINGS[:3]


@dataclass(frozen=True, slots=True, eq=False)
class Counters:
    """Of a ray so far, by the numbers of `WalkEvent`: how many there were, and the nanoseconds that they took."""

    counts: npt.NDArray[np.int64]
    nanoseconds: npt.NDArray[np.float64]

    def number(self, *events: WalkEvent) -> int:
        """Of some kinds together."""
        return int(self.counts[list(events)].sum())

    def time(self, *events: WalkEvent) -> int:
        """Of some kinds together, in nanoseconds: rounded a kind, so that what is written adds up."""
        return int(np.rint(self.nanoseconds[list(events)]).sum())

    @property
    def boxes_tested(self) -> int:
        return self.number(*BOX_TESTS)

    @property
    def boxes_hit(self) -> int:
        """Of those tested; they are entered later, or pruned after all."""
        return self.number(WalkEvent.BOX_HIT)

    @property
    def boxes_entered(self) -> int:
        return self.number(*_ENTERED)

    @property
    def boxes_missed(self) -> int:
        return self.number(WalkEvent.BOX_MISSED)

    @property
    def boxes_pruned(self) -> int:
        return self.number(WalkEvent.BOX_PRUNED, WalkEvent.WAITING_PRUNED)

    @property
    def triangles_tested(self) -> int:
        return self.number(*TRIANGLE_TESTS)

    @property
    def triangles_hit(self) -> int:
        return self.number(WalkEvent.TRIANGLE_HIT)

    @property
    def visits(self) -> int:
        """Nodes and instances."""
        return self.number(*VISITS)

    @property
    def cost(self) -> int:
        """In the units of the surface area heuristic, as elsewhere."""
        return self.visits + self.triangles_tested

    @property
    def total_time(self) -> int:
        """Of all together, in nanoseconds."""
        return self.time(*WalkEvent)


@dataclass(frozen=True, slots=True)
class WalkStep:
    """rows: of the walk, none for the last step. sentence: what happens. counters: with this step."""

    rows: range
    sentence: str
    counters: Counters


def steps_of(words: WalkWords) -> list[WalkStep]:
    """All steps of the ray that the words are for."""
    walk, spent = words.walk, words.walk.nanoseconds()
    firsts = _first_rows(walk.events)
    found = []
    for first, end in zip(firsts, [*firsts[1:], len(walk)], strict=False):
        rows = range(first, end)
        found.append(WalkStep(rows, words.of_step(rows), count(walk, end, spent)))
    return [*found, WalkStep(range(len(walk), len(walk)), words.ending(), count(walk, len(walk), spent))]


def _first_rows(events: npt.NDArray[np.uint8]) -> list[int]:
    is_pruned = events == WalkEvent.WAITING_PRUNED
    begins_pruning = is_pruned & ~np.concatenate([[False], is_pruned[:-1]])
    return [int(row) for row in np.flatnonzero(np.isin(events, _BEGINNINGS) | begins_pruning)]


def count(walk: RayWalk, end: int, nanoseconds: npt.NDArray[np.float64]) -> Counters:
    """What the events before a row come to. nanoseconds: of each event."""
    events, kinds = walk.events[:end], len(WalkEvent)
    return Counters(np.bincount(events, minlength=kinds), np.bincount(events, nanoseconds[:end], kinds))
