"""What a ray does on its way, in sentences: a step of it, or one box or triangle of a step. Knows no Blender.

They begin in upper case and have no full stop.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from perfect_bvh import WalkEvent

from ...statistics.words import count_of, primitive_of, primitives, sentence

if TYPE_CHECKING:
    from perfect_bvh import RayWalk

    from ...sync.records import MeshKind

TOP_LEVEL = "the top level"
# How a distance from the ray's beginning is written; None where that tells nobody anything.
Length = Callable[[float], str] | None
_OUTCOMES = ((WalkEvent.BOX_HIT, "hit"), (WalkEvent.BOX_MISSED, "missed"), (WalkEvent.BOX_PRUNED, "pruned"))


@dataclass(frozen=True, slots=True)
class WalkWords:
    """Of one ray. names: of the instances it meets, by their ids. kinds: of their meshes, unless of triangles."""

    walk: RayWalk
    names: Mapping[int, str]
    length: Length
    kinds: Mapping[int, MeshKind] = field(default_factory=dict)

    # Steps -----------------------------------------------------------------------------------------------------------

    def of_step(self, rows: range) -> str:
        """What happens in some rows of the walk, which are a step."""
        event, count = WalkEvent(self.walk.events[rows.start]), len(rows)
        if event is WalkEvent.WAITING_PRUNED:
            boxes = count_of(count, "waiting box", "waiting boxes")
            return f"Drops {boxes} of {self._tree(rows.start)} behind the hit"
        if event is WalkEvent.ENTER_LEAF:
            tested = primitives(count - 1, self._kind(rows.start))
            return f"Tests {tested} of a leaf at {self._place(rows.start)}: {self._outcome(rows)}"
        if event is not WalkEvent.ENTER_NODE:
            return self._instance(rows.start)
        events = self.walk.events[rows.start : rows.stop]
        parts = [f"{int((events == kind).sum())} {word}" for kind, word in _OUTCOMES if (events == kind).any()]
        return f"Enters {self._node(rows.start)} and tests {count - 1} inside: {', '.join(parts)}"

    def ending(self) -> str:
        """What was hit."""
        row = self.walk.hit_row
        if row is None:
            return "Nothing is hit"
        return f"The nearest hit is {self.names[int(self.walk.instance_ids[row])]}{self._at(self.walk.t[row])}"

    def _outcome(self, rows: range) -> str:
        events = self.walk.events[rows.start : rows.stop]
        if (events == WalkEvent.TRIANGLE_HIT).any():
            return f"hit{self._at(self.walk.nearest_t[rows.stop - 1])}"
        return "none is nearer" if (events == WalkEvent.TRIANGLE_REJECTED).any() else "none is hit"

    # Parts of steps --------------------------------------------------------------------------------------------------

    def of_event(self, rows: range, row: int) -> str:
        """What happens in one of the rows of a step."""
        event = WalkEvent(self.walk.events[row])
        if event is WalkEvent.ENTER_NODE:
            inside = count_of(len(rows) - 1, "box", "boxes")
            return f"Enters {self._node(row)}: {inside} inside, tested at once"
        if event is WalkEvent.ENTER_LEAF:
            inside = primitives(len(rows) - 1, self._kind(row))
            return f"Enters a leaf at {self._place(row)}: {inside}, tested at once"
        if event in (WalkEvent.ENTER_INSTANCE, WalkEvent.SKIP_INSTANCE):
            return self._instance(row)
        number, count = row - rows.start, len(rows) - 1
        if event is WalkEvent.WAITING_PRUNED:
            return f"Waiting box {number + 1} of {count + 1}: {self._behind(row, 'begins')}, dropped"
        what = sentence(primitive_of(self._kind(row))) if self.walk.primitive_ids[row] >= 0 else "Box"
        return f"{what} {number} of {count} at {self._place(row)}: {self._fate(event, row)}"

    def _fate(self, event: WalkEvent, row: int) -> str:
        at = self._at(self.walk.t[row])
        if event in (WalkEvent.BOX_MISSED, WalkEvent.TRIANGLE_MISSED):
            return "missed"
        if event is WalkEvent.BOX_HIT:
            return f"entered{at}, waits for its turn"
        if event is WalkEvent.BOX_PRUNED:
            return f"{self._behind(row, 'begins')}, pruned"
        if event is WalkEvent.TRIANGLE_HIT:
            return f"hit{at}, the nearest so far"
        if self.walk.t[row] < self.walk.nearest_t[row]:
            return f"met{at}, where the ray does not look"
        return self._behind(row, "met")

    def _behind(self, row: int, what: str) -> str:
        """Of a box or a triangle that a hit stands before."""
        return f"{what}{self._at(self.walk.t[row])}, behind the nearer hit{self._at(self.walk.nearest_t[row])}"

    # Names -----------------------------------------------------------------------------------------------------------

    def tested(self) -> str:
        """What all that the ray tests in leaves are called, as a title."""
        walk = self.walk
        kinds = {self._kind(row) for row in np.flatnonzero(walk.primitive_ids >= 0)}
        return sentence(primitive_of(kinds.pop()) + "s") if len(kinds) == 1 else "Primitives"

    def _kind(self, row: int) -> MeshKind:
        return self.kinds.get(int(self.walk.instance_ids[row]), "triangles")

    def _tree(self, row: int) -> str:
        return self.names.get(int(self.walk.instance_ids[row]), TOP_LEVEL)

    def _place(self, row: int) -> str:
        return f"level {int(self.walk.levels[row])} of {self._tree(row)}"

    def _node(self, row: int) -> str:
        is_root = not self.walk.levels[row]
        return f"the root box of {self._tree(row)}" if is_root else f"a box at {self._place(row)}"

    def _instance(self, row: int) -> str:
        if self.walk.events[row] == WalkEvent.SKIP_INSTANCE:
            return f"Passes by {self._tree(row)}, which it does not see"
        return f"Enters the tree of {self._tree(row)}, with the ray in its space"

    def _at(self, t: float) -> str:
        return "" if self.length is None or not np.isfinite(t) else f" at {self.length(float(t))}"
