"""A ray's walk while it is shown: where in it somebody stands, forwards and back, and whether it still holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import bpy
import numpy as np
import numpy.typing as npt

from ...events.changes import edit_count
from .walk_picture import Picture, WalkedRay, picture_of
from .walk_steps import Counters, WalkStep, count
from .walk_words import WalkWords

CHANGED = "The scene has changed: walk again"


@dataclass(frozen=True, slots=True)
class SceneState:
    """A scene at some time, as far as handlers are told."""

    scene_uid: int
    frame: float
    edits: int

    @staticmethod
    def of(scene: bpy.types.Scene) -> SceneState:
        return SceneState(scene.session_uid, scene.frame_current_final, edit_count(scene.session_uid))


@dataclass(slots=True)
class ShownWalk:
    """A walk and where it is told of.

    read: the scene when it was read. space: the viewport's address, which stays when its area is maximized; view: that
    of the part that was clicked, one of four in a quad view. index: of the step that is shown. part: the number of the
    one of its rows that is shown, with those before; None for all of them.
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

    # What is shown ---------------------------------------------------------------------------------------------------

    @property
    def step(self) -> WalkStep:
        """The one that is shown."""
        return self.steps[self.index]

    @property
    def row(self) -> int | None:
        """Of the walk, if a single one of the step is shown."""
        return None if self.part is None else self.step.rows[self.part]

    @property
    def heading(self) -> str:
        """Such as "Step 12 of 57: Enters a box at level 3 of Tree.004 and tests 8 inside: 2 hit, 6 missed"."""
        sentence = self.step.sentence if self.row is None else self.words.of_event(self.step.rows, self.row)
        return f"{place_of(self.index, len(self.steps))}: {sentence}"

    @property
    def counters(self) -> Counters:
        """With what is shown."""
        return self.step.counters if self.row is None else count(self.ray.walk, self.row + 1, self._spent)

    @property
    def picture(self) -> Picture:
        """Of what is shown, made when it is drawn first."""
        place = self.index, self.part
        if self._drawn is None or self._drawn[0] != place:
            self._drawn = place, picture_of(self.ray, self.step, self.row)
        return self._drawn[1]

    # Forwards and back -----------------------------------------------------------------------------------------------

    def go(self, index: int) -> None:
        """To a whole step, or the nearest that there is; at the last one nothing plays any more."""
        self.index, self.part = min(max(index, 0), len(self.steps) - 1), None
        if self.index == len(self.steps) - 1:
            self.is_playing = False

    def go_on(self) -> None:
        """As the steps play: by boxes from where a box is shown, else by steps."""
        if self.part is None:
            self.go(self.index + 1)
        else:
            self.go_to_next_box()

    def go_to_next_step(self) -> None:
        """Of a part, to the whole that it is of."""
        self.go(self.index + (self.part is None))

    def go_to_next_box(self) -> None:
        """Or the next triangle, or whatever happens next."""
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
        """From the beginning, if the end is shown."""
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
    """Such as "Step 12 of 57"."""
    return f"Step {index + 1:,} of {count_of_steps:,}"
