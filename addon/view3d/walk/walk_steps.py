"""The walk of a ray, as steps with a sentence and counters. Does not depend on Blender.

A step is one action of the processor: a node with the boxes of its children, a leaf with its triangles, an
instance that is entered, waiting boxes that a new hit makes superfluous. The last one names the hit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from perfect_bvh import WalkEvent
from perfect_bvh.ray_walk import BOX_TESTS, TRIANGLE_TESTS, VISITS

from ...statistics.words import count_of, primitive_of, primitives, sentence
from ...sync.records import CameraRecord

if TYPE_CHECKING:
    from perfect_bvh import RayWalk

    from ...sync.records import MeshKind


_BEGINNINGS = (WalkEvent.ENTER_NODE, WalkEvent.ENTER_LEAF, WalkEvent.ENTER_INSTANCE, WalkEvent.SKIP_INSTANCE)
_ENTERED = _BEGINNINGS[:3]


@dataclass(frozen=True, slots=True, eq=False)
class Counters:
    """The counts of a ray so far, by the numbers of `WalkEvent`, and their nanoseconds."""

    counts: npt.NDArray[np.int64]
    nanoseconds: npt.NDArray[np.float64]

    def number(self, *events: WalkEvent) -> int:
        """Returns the number of events of some kinds."""
        return int(self.counts[list(events)].sum())

    def time(self, *events: WalkEvent) -> int:
        """Returns the nanoseconds of some kinds, each rounded separately, so that the shown numbers add up."""
        return int(np.rint(self.nanoseconds[list(events)]).sum())

    @property
    def boxes_tested(self) -> int:
        return self.number(*BOX_TESTS)

    @property
    def boxes_hit(self) -> int:
        """The number of tested boxes that were hit; they are entered later, or pruned."""
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
        """The cost in the units of the surface area heuristic, as elsewhere."""
        return self.visits + self.triangles_tested

    @property
    def total_time(self) -> int:
        """The nanoseconds of all events."""
        return self.time(*WalkEvent)


@dataclass(frozen=True, slots=True)
class WalkStep:
    """rows: of the walk, none for the last step. sentence: what happens. counters: with this step."""

    rows: range
    sentence: str
    counters: Counters


def steps_of(words: WalkWords) -> list[WalkStep]:
    """Returns all steps of the ray of these words."""
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
    """Sums up the events before a row. nanoseconds: of each event."""
    events, kinds = walk.events[:end], len(WalkEvent)
    return Counters(np.bincount(events, minlength=kinds), np.bincount(events, nanoseconds[:end], kinds))


# Walk words ----------------------------------------------------------------------------------------------------------
# The events of a walk in sentences: a step, or one box or triangle of a step.
#
# They begin in upper case and have no full stop.


TOP_LEVEL = "the top level"
# Formats a distance from the ray's beginning; None where it is not useful.
Length = Callable[[float], str] | None
_OUTCOMES = ((WalkEvent.BOX_HIT, "hit"), (WalkEvent.BOX_MISSED, "missed"), (WalkEvent.BOX_PRUNED, "pruned"))


@dataclass(frozen=True, slots=True)
class WalkWords:
    """Words for one ray. names: of the instances it hits, by their ids. kinds: of their meshes, unless of triangles."""

    walk: RayWalk
    names: Mapping[int, str]
    length: Length
    kinds: Mapping[int, MeshKind] = field(default_factory=dict)

    # Steps -----------------------------------------------------------------------------------------------------------

    def of_step(self, rows: range) -> str:
        """Describes the rows of a step of the walk."""
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
        """Names the hit."""
        row = self.walk.hit_row
        if row is None:
            return "The ray hits nothing"
        return f"The nearest hit is {self.names[int(self.walk.instance_ids[row])]}{self._at(self.walk.t[row])}"

    def _outcome(self, rows: range) -> str:
        events = self.walk.events[rows.start : rows.stop]
        if (events == WalkEvent.TRIANGLE_HIT).any():
            return f"hit{self._at(self.walk.nearest_t[rows.stop - 1])}"
        return "none is nearer" if (events == WalkEvent.TRIANGLE_REJECTED).any() else "none is hit"

    # Parts of steps --------------------------------------------------------------------------------------------------

    def of_event(self, rows: range, row: int) -> str:
        """Describes one of the rows of a step."""
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
            return f"entered{at}, visited later"
        if event is WalkEvent.BOX_PRUNED:
            return f"{self._behind(row, 'begins')}, pruned"
        if event is WalkEvent.TRIANGLE_HIT:
            return f"hit{at}, the nearest so far"
        if self.walk.t[row] < self.walk.nearest_t[row]:
            return f"hit{at}, outside the ray's range or on a culled side"
        return self._behind(row, "hit")

    def _behind(self, row: int, what: str) -> str:
        """Describes a box or a triangle behind a hit."""
        return f"{what}{self._at(self.walk.t[row])}, behind the nearer hit{self._at(self.walk.nearest_t[row])}"

    # Names -----------------------------------------------------------------------------------------------------------

    def tested(self) -> str:
        """Returns the title of the primitives tested in leaves."""
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
            return f"Passes {self._tree(row)}, which is not visible to it"
        return f"Enters the BVH of {self._tree(row)}, with the ray in its space"

    def _at(self, t: float) -> str:
        return "" if self.length is None or not np.isfinite(t) else f" at {self.length(float(t))}"


# Pixel ray -----------------------------------------------------------------------------------------------------------
# The ray through a point of a region, as the picture of that region is traced.


Float64Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PixelRay:
    """origin, direction: (3,), of length one: t is a distance. t_min, t_max: the range of the view.

    has_eye: whether it begins at an eye: rays of orthographic views begin far outside.
    """

    origin: Float64Array
    direction: Float64Array
    t_min: float
    t_max: float
    has_eye: bool


def pixel_ray(camera: CameraRecord, x: float, y: float) -> PixelRay | None:
    """x, y: the place in the region as fractions from its lower left corner. None where nothing is seen."""
    left, right, bottom, top = camera.window
    across, up = left + x * (right - left), bottom + y * (top - bottom)
    origin, direction = np.zeros(3), np.array([across, up, -1.0])
    if camera.projection == "orthographic":
        origin, direction = np.array([across, up, 0.0]), np.array([0.0, 0.0, -1.0])
    elif camera.projection == "equirectangular":
        west, east, south, north = camera.border
        if not (west <= x <= east and south <= y <= north):
            return None
        direction = np.array([np.sin(across) * np.cos(up), np.sin(up), -np.cos(across) * np.cos(up)])
    length = float(np.linalg.norm(direction))
    turn = camera.matrix[:3, :3]
    return PixelRay(
        origin=turn @ origin + camera.matrix[:3, 3],
        direction=turn @ (direction / length),
        t_min=camera.clip_start * length,  # clipping goes by the view's axis
        t_max=camera.clip_end * length,
        has_eye=camera.projection != "orthographic",
    )
