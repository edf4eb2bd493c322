"""What a ray does on its way, as steps with a sentence and counters. Knows no Blender.

A step is what the processor does at a time: a node with the boxes of its children, a leaf with its triangles, an
instance that is entered, waiting boxes that a new hit makes superfluous. The last one says what was hit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from perfect_bvh import WalkEvent
from perfect_bvh.ray_walk import BOX_TESTS, TRIANGLE_TESTS, VISITS

from ..statistics.words import count_of

if TYPE_CHECKING:
    from perfect_bvh import RayWalk

TOP_LEVEL = "the top level"
# How a distance from the ray's beginning is written; None where that tells nobody anything.
Length = Callable[[float], str] | None
_BEGINNINGS = (WalkEvent.ENTER_NODE, WalkEvent.ENTER_LEAF, WalkEvent.ENTER_INSTANCE, WalkEvent.SKIP_INSTANCE)
_ENTERED = _BEGINNINGS[:3]


@dataclass(frozen=True, slots=True)
class Counters:
    """Of a ray so far. visits: nodes and instances, each of which costs one, as each tested triangle does.

    boxes_hit: of those tested; they are entered later, or pruned after all.
    """

    boxes_tested: int
    boxes_hit: int
    boxes_entered: int
    boxes_missed: int
    boxes_pruned: int
    triangles_tested: int
    triangles_hit: int
    visits: int

    @property
    def cost(self) -> int:
        """In the units of the surface area heuristic, as elsewhere."""
        return self.visits + self.triangles_tested


@dataclass(frozen=True, slots=True)
class WalkStep:
    """rows: of the walk, none for the last step. sentence: what happens, beginning in upper case, without a full stop.

    counters: with this step.
    """

    rows: range
    sentence: str
    counters: Counters


def steps_of(walk: RayWalk, names: Mapping[int, str], length: Length = "{:.4g}".format) -> list[WalkStep]:
    """All steps of a ray. names: of the instances it meets, by their ids."""
    firsts = _first_rows(walk.events)
    found = []
    for first, end in zip(firsts, [*firsts[1:], len(walk)], strict=False):
        rows = range(first, end)
        found.append(WalkStep(rows, _sentence(walk, rows, names, length), count(walk, end)))
    return [*found, WalkStep(range(len(walk), len(walk)), _ending(walk, names, length), count(walk, len(walk)))]


def _first_rows(events: npt.NDArray[np.uint8]) -> list[int]:
    is_pruned = events == WalkEvent.WAITING_PRUNED
    begins_pruning = is_pruned & ~np.concatenate([[False], is_pruned[:-1]])
    return [int(row) for row in np.flatnonzero(np.isin(events, _BEGINNINGS) | begins_pruning)]


def count(walk: RayWalk, end: int) -> Counters:
    """What the events before a row come to."""
    totals = np.bincount(walk.events[:end], minlength=len(WalkEvent))

    def sum_of(*events: WalkEvent) -> int:
        return int(sum(totals[event] for event in events))

    return Counters(
        boxes_tested=sum_of(*BOX_TESTS),
        boxes_hit=sum_of(WalkEvent.BOX_HIT),
        boxes_entered=sum_of(*_ENTERED),
        boxes_missed=sum_of(WalkEvent.BOX_MISSED),
        boxes_pruned=sum_of(WalkEvent.BOX_PRUNED, WalkEvent.WAITING_PRUNED),
        triangles_tested=sum_of(*TRIANGLE_TESTS),
        triangles_hit=sum_of(WalkEvent.TRIANGLE_HIT),
        visits=sum_of(*VISITS),
    )


# Sentences -----------------------------------------------------------------------------------------------------------


def _sentence(walk: RayWalk, rows: range, names: Mapping[int, str], length: Length) -> str:
    first = rows.start
    event, instance = WalkEvent(walk.events[first]), int(walk.instance_ids[first])
    name = names.get(instance, TOP_LEVEL)
    level = int(walk.levels[first])
    events = walk.events[rows.start : rows.stop]
    if event is WalkEvent.ENTER_INSTANCE:
        return f"Enters the tree of {name}, with the ray in its space"
    if event is WalkEvent.SKIP_INSTANCE:
        return f"Passes by {name}, which it does not see"
    if event is WalkEvent.WAITING_PRUNED:
        boxes = count_of(len(rows), "waiting box", "waiting boxes")
        return f"Drops {boxes} of {name} behind the hit"
    place = f"level {level} of {name}"
    if event is WalkEvent.ENTER_LEAF:
        return f"Tests {count_of(len(rows) - 1, 'triangle')} of a leaf at {place}: {_outcome(walk, rows, length)}"
    parts = [f"{int((events == kind).sum())} {word}" for kind, word in _OUTCOMES if (events == kind).any()]
    entered = f"the root box of {name}" if level == 0 else f"a box at {place}"
    return f"Enters {entered} and tests {len(rows) - 1} inside: {', '.join(parts)}"


_OUTCOMES = ((WalkEvent.BOX_HIT, "hit"), (WalkEvent.BOX_MISSED, "missed"), (WalkEvent.BOX_PRUNED, "pruned"))


def _outcome(walk: RayWalk, rows: range, length: Length) -> str:
    events = walk.events[rows.start : rows.stop]
    if (events == WalkEvent.TRIANGLE_HIT).any():
        return f"hit{_at(float(walk.nearest_t[rows.stop - 1]), length)}"
    return "none is nearer" if (events == WalkEvent.TRIANGLE_REJECTED).any() else "none is hit"


def _ending(walk: RayWalk, names: Mapping[int, str], length: Length) -> str:
    row = walk.hit_row
    if row is None:
        return "Nothing is hit"
    return f"The nearest hit is {names[int(walk.instance_ids[row])]}{_at(float(walk.t[row]), length)}"


def _at(t: float, length: Length) -> str:
    return "" if length is None else f" at {length(t)}"
