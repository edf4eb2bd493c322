"""The picture of one step of a ray's walk: lines and filled triangles with colours. Does not depend on Blender.

The current step is bright, earlier steps are faint, and later steps are not drawn yet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import bpy
import numpy as np
import numpy.typing as npt
from perfect_bvh import WalkEvent

from ...events.changes import edit_count
from ..drawing import EDGES
from .walk_steps import Counters, WalkStep, WalkWords, count

if TYPE_CHECKING:
    from perfect_bvh import RayWalk


Float32Array = npt.NDArray[np.float32]
Float64Array = npt.NDArray[np.float64]
Color = tuple[float, float, float]

ENTERED: Color = (1.0, 0.83, 0.2)
WAITING: Color = (0.3, 0.68, 1.0)  # hit by the ray, and not entered yet
MISSED: Color = (0.72, 0.72, 0.72)
PRUNED: Color = (0.93, 0.36, 0.86)
TESTED: Color = (1.0, 0.52, 0.12)
HIT: Color = (0.35, 1.0, 0.4)
RAY: Color = (1.0, 1.0, 1.0)

EVENT_COLORS = {
    WalkEvent.ENTER_NODE: ENTERED,
    WalkEvent.ENTER_LEAF: ENTERED,
    WalkEvent.ENTER_INSTANCE: ENTERED,
    WalkEvent.SKIP_INSTANCE: MISSED,
    WalkEvent.BOX_HIT: WAITING,
    WalkEvent.BOX_MISSED: MISSED,
    WalkEvent.BOX_PRUNED: PRUNED,
    WalkEvent.WAITING_PRUNED: PRUNED,
    WalkEvent.TRIANGLE_MISSED: TESTED,
    WalkEvent.TRIANGLE_REJECTED: TESTED,
    WalkEvent.TRIANGLE_HIT: HIT,
}
_ENTERING = (WalkEvent.ENTER_NODE, WalkEvent.ENTER_LEAF, WalkEvent.ENTER_INSTANCE)
# Opacities, and widths in points.
BRIGHT, BESIDE, FAINT, FILLED = 1.0, 0.5, 0.25, 0.55
MISSED_SHARE = 0.6  # of these: missed boxes are the least important
THICK, WIDE, THIN = 3.0, 1.8, 1.0
# Earlier misses are not drawn; of the boxes and triangles entered or tested before, only the last ones are.
MOST_EARLIER = 400


@dataclass(frozen=True, slots=True)
class Lines:
    """positions: (2N, 3) float32, ends of N lines. colors: (2N, 4) float32 RGBA. width: in points."""

    positions: Float32Array
    colors: Float32Array
    width: float


@dataclass(frozen=True, slots=True)
class Picture:
    """lines: the later ones over the earlier. triangles: (3N, 3) float32 with colors (3N, 4).

    tip: (3,), the end of the ray's bright part, which the eye that looks along the ray sees as a point. hit: (3,) or
    None.
    """

    lines: list[Lines]
    triangles: Float32Array
    triangle_colors: Float32Array
    tip: Float64Array
    hit: Float64Array | None


@dataclass(frozen=True, slots=True)
class WalkedRay:
    """A ray and its walk. origin, direction: (3,) float64, the latter of length one. exit: behind all boxes."""

    walk: RayWalk
    origin: Float64Array
    direction: Float64Array
    t_min: float
    exit: float
    corners: Float64Array  # (N, 8, 3), of each event's box in the world

    @classmethod
    def of(cls, walk: RayWalk, origin: Float64Array, direction: Float64Array, t_min: float) -> WalkedRay:
        """Makes the ray of a query of the trees."""
        corners = walk.world_boxes()
        behind = max(float(((corners - origin) @ direction).max(initial=t_min)), t_min) * 1.05 + 1e-6
        return cls(walk, origin, direction, t_min, behind, corners)

    def end(self, row: int) -> float:
        """Returns the ray's end after an event: the nearest hit so far, or else a point behind all boxes."""
        return min(float(self.walk.nearest_t[row]), self.exit) if len(self.walk) else self.exit

    def at(self, t: float) -> Float64Array:
        """A point of the ray."""
        return self.origin + t * self.direction


def picture_of(ray: WalkedRay, step: WalkStep, row: int | None = None) -> Picture:
    """Makes the picture of one step of this ray. row: the only bright one of its rows; None for all."""
    walk, rows = ray.walk, step.rows
    span = span_in_box(ray, _spanned(ray, rows, row)) if len(rows) else (ray.t_min, ray.end(-1))
    is_now, is_beside = np.zeros(len(walk), bool), np.zeros(len(walk), bool)
    if row is None:
        is_now[rows.start : rows.stop] = True
    else:
        is_now[row] = is_beside[rows.start : row] = True
        is_beside[row] = False
    is_box = walk.primitive_ids < 0
    before = np.arange(len(walk)) < rows.start
    earlier = np.flatnonzero(before & np.isin(walk.events, _ENTERING))[-MOST_EARLIER:]
    lines = [
        _boxes(ray, earlier, FAINT, THIN),
        _boxes(ray, np.flatnonzero(is_beside & is_box)[::-1], BESIDE, THIN),
        _boxes(ray, np.flatnonzero(is_now & is_box)[::-1], BRIGHT, WIDE),  # the one that is entered over its children
        *_ray_lines(ray, rows.start if row is None else row, span),
    ]
    hits = np.flatnonzero((walk.events == WalkEvent.TRIANGLE_HIT) & (before | is_beside | is_now))
    shown = np.flatnonzero(is_now & ~is_box)
    if len(hits):
        shown = np.union1d(shown, hits[-1:])
    lines.insert(1, _outlines(ray, np.flatnonzero((before | is_beside) & ~is_box)[-MOST_EARLIER:]))
    colors = _colors(walk.events[shown], FILLED).repeat(3, axis=0)
    return Picture(
        lines=[part for part in lines if len(part.positions)],
        triangles=walk.triangles[shown].reshape(-1, 3).astype(np.float32),
        triangle_colors=colors,
        tip=ray.at(span[1]),
        hit=ray.at(float(walk.t[hits[-1]])) if len(hits) else None,
    )


def _boxes(ray: WalkedRay, rows: npt.NDArray[np.intp], opacity: float, width: float) -> Lines:
    ends = ray.corners[rows][:, EDGES.ravel()]
    colors = _colors(ray.walk.events[rows], opacity).repeat(EDGES.size, axis=0)
    return Lines(ends.reshape(-1, 3).astype(np.float32), colors, width)


def _outlines(ray: WalkedRay, rows: npt.NDArray[np.intp]) -> Lines:
    ends = ray.walk.triangles[rows][:, [0, 1, 1, 2, 2, 0]]
    colors = _colors(ray.walk.events[rows], FAINT).repeat(6, axis=0)
    return Lines(ends.reshape(-1, 3).astype(np.float32), colors, THIN)


def _colors(events: npt.NDArray[np.uint8], opacity: float) -> Float32Array:
    table = np.array([EVENT_COLORS[event] for event in WalkEvent], np.float32)
    shares = np.array([MISSED_SHARE if EVENT_COLORS[event] is MISSED else 1.0 for event in WalkEvent], np.float32)
    return np.concatenate([table[events], opacity * shares[events][:, None]], axis=1)


def _spanned(ray: WalkedRay, rows: range, row: int | None) -> int:
    """Returns the row of the box in which the ray is bright; missed and pruned boxes have none."""
    return row if row is not None and ray.walk.events[row] == WalkEvent.BOX_HIT else rows.start


def _ray_lines(ray: WalkedRay, first: int, span: tuple[float, float]) -> list[Lines]:
    """Draws the ray up to a row, and the described part: that in a box, or the whole ray."""
    whole = _line(ray, (ray.t_min, ray.end(first - 1) if first > 0 else ray.exit), 0.55, THIN)
    return [whole, _line(ray, span, BRIGHT, THICK)]


def _line(ray: WalkedRay, span: tuple[float, float], opacity: float, width: float) -> Lines:
    ends = np.stack([ray.at(t) for t in span]).astype(np.float32)
    return Lines(ends, np.full((2, 4), (*RAY, opacity), np.float32), width)


def span_in_box(ray: WalkedRay, row: int) -> tuple[float, float]:
    """Returns the interval of a ray in the box of an event, within its range before the event."""
    linear, place = ray.walk.transforms[row][:, :3], ray.walk.transforms[row][:, 3]
    if not abs(np.linalg.det(linear)) > 0.0:
        return ray.t_min, ray.t_min
    origin = np.linalg.solve(linear, ray.origin - place)
    direction = np.linalg.solve(linear, ray.direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        planes = (ray.walk.bounds[row] - origin) / direction
    planes = np.where(np.isnan(planes), [[-np.inf], [np.inf]], planes)  # along a face of the box
    first, last = float(planes.min(axis=0).max()), float(planes.max(axis=0).min())
    end = ray.end(row)
    first = min(max(first, ray.t_min), end)
    return first, min(max(last, first), end)


# Shown walk ----------------------------------------------------------------------------------------------------------
# A ray's walk while it is shown: the current position in it, steps forwards and back, and whether it is still valid.


CHANGED = "The scene has changed: walk again"


@dataclass(frozen=True, slots=True)
class SceneState:
    """The state of a scene at some time, as far as handlers report it."""

    scene_uid: int
    frame: float
    edits: int

    @staticmethod
    def of(scene: bpy.types.Scene) -> SceneState:
        return SceneState(scene.session_uid, scene.frame_current_final, edit_count(scene.session_uid))


@dataclass(slots=True)
class ShownWalk:
    """A walk and its current position.

    read: the scene when it was read. space: the viewport's address, which stays when its area is maximized; view: that
    of the clicked part, one of four in a quad view. index: of the shown step. part: the number of the
    shown row of the step; earlier rows are shown, too. None for all rows.
    """

    ray: WalkedRay
    words: WalkWords
    steps: Sequence[WalkStep]
    read: SceneState
    space: int
    view: int
    index: int = 0
    part: int | None = None
    is_playing: bool = False
    _is_over: bool = False
    _spent: npt.NDArray[np.float64] = field(init=False)
    _drawn: tuple[tuple[int, int | None], Picture] | None = None

    def __post_init__(self) -> None:
        self._spent = self.ray.walk.nanoseconds()

    # Shown part ------------------------------------------------------------------------------------------------------

    @property
    def step(self) -> WalkStep:
        """The one that is shown."""
        return self.steps[self.index]

    @property
    def row(self) -> int | None:
        """The row of the walk, if only one row of the step is shown."""
        return None if self.part is None else self.step.rows[self.part]

    @property
    def heading(self) -> str:
        """The title: "Step 12 of 57: Enters a box at level 3 of Tree.004 and tests 8 inside: 2 hit, 6 missed"."""
        sentence = self.step.sentence if self.row is None else self.words.of_event(self.step.rows, self.row)
        return f"{place_of(self.index, len(self.steps))}: {sentence}"

    @property
    def counters(self) -> Counters:
        """The counters up to the shown position."""
        return self.step.counters if self.row is None else count(self.ray.walk, self.row + 1, self._spent)

    @property
    def picture(self) -> Picture:
        """The picture of the shown position, made when it is first drawn."""
        place = self.index, self.part
        if self._drawn is None or self._drawn[0] != place:
            self._drawn = place, picture_of(self.ray, self.step, self.row)
        return self._drawn[1]

    # Forwards and back -----------------------------------------------------------------------------------------------

    def go(self, index: int) -> None:
        """Goes to a whole step, or the nearest one; at the last one, playing stops."""
        self.index, self.part = min(max(index, 0), len(self.steps) - 1), None
        if self.index == len(self.steps) - 1:
            self.is_playing = False

    def go_on(self) -> None:
        """Advances by boxes if a box is shown, else by steps."""
        if self.part is None:
            self.go(self.index + 1)
        else:
            self.go_to_next_box()

    def go_to_next_step(self) -> None:
        """Goes to the next step; from a part of a step to the whole step."""
        self.go(self.index + (self.part is None))

    def go_to_next_box(self) -> None:
        """Goes to the next box or triangle, or to the next other event."""
        following = 0 if self.part is None else self.part + 1
        if self.part is not None and following < len(self.step.rows):
            self.part = following
            return
        self.go(self.index + 1)
        if self.step.rows:
            self.part = 0

    def go_to_previous_box(self) -> None:
        """The other way round."""
        shown = len(self.step.rows) - 1 if self.part is None else self.part
        if shown > 0:
            self.part = shown - 1
        elif self.index:
            self.go(self.index - 1)
            self.part = len(self.step.rows) - 1

    def play_or_pause(self) -> None:
        """Plays or pauses; at the end it plays from the beginning."""
        if not self.is_playing and self.index == len(self.steps) - 1:
            self.go(0)
        self.is_playing = not self.is_playing and len(self.steps) > 1

    # Whether it holds ------------------------------------------------------------------------------------------------

    def is_old(self, scene: bpy.types.Scene) -> bool:
        """Whether the scene is another one by now, as far as is known; then it stays so."""
        if not self._is_over and SceneState.of(scene) != self.read:
            self._is_over, self.is_playing = True, False
        return self._is_over


def place_of(index: int, count_of_steps: int) -> str:
    """Formats a position, such as "Step 12 of 57"."""
    return f"Step {index + 1:,} of {count_of_steps:,}"
