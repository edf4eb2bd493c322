"""A shutter around a frame: at which frames its moments are, and going there and back.

Blender evaluates one moment at a time. However the way through them ends, the scene is at the frame and subframe in the
end where it was at first, with the camera that it had.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

FrameSet = Callable[[int, float], object]
Place = tuple[int, float]  # a frame, and how far after it as float32 holds it, 0 to below 1

MOST_STEPS = 255
_FARTHEST = 1_048_574  # frames of Blender, from zero


@dataclass(frozen=True, slots=True)
class Shutter:
    """begin, end: in frames relative to the current one. steps: of what says nothing else; None: as Cycles has it.

    frame_set: called with a frame and a subframe, makes Blender evaluate what is read; None: the scene's own.
    """

    begin: float
    end: float
    steps: int | None = None
    frame_set: FrameSet | None = None

    def offset(self, time: Fraction) -> float:
        """Of a moment, 0 to 1, in frames from the current one."""
        return float(1 - time) * self.begin + float(time) * self.end


def as_shutter(function: str, shutter: Any, steps: Any, frame_set: FrameSet | None) -> Shutter | None:
    """What a caller's arguments say; None without a shutter. Raises ValueError for what is none."""
    if shutter is None:
        for name, value in (("steps", steps), ("frame_set", frame_set)):
            if value is not None:
                raise ValueError(f"{function}: {name} needs a shutter, got {value!r} without one")
        return None
    begin, end = _as_range(function, shutter)
    if frame_set is not None and not callable(frame_set):
        raise ValueError(f"{function}: frame_set must be a function of a frame and a subframe, got {frame_set!r}")
    return Shutter(begin, end, None if steps is None else _as_steps(function, steps), frame_set)


def _as_range(function: str, shutter: Any) -> tuple[float, float]:
    what = f"{function}: shutter must be two finite numbers of frames (begin, end) with begin < end"
    try:
        begin, end = (float(number) for number in shutter)
    except (TypeError, ValueError):
        raise ValueError(f"{what}, got {shutter!r}") from None
    if not (math.isfinite(begin) and math.isfinite(end) and begin < end):
        raise ValueError(f"{what}, got {shutter!r}")
    if max(abs(begin), abs(end)) > _FARTHEST:
        raise ValueError(
            f"{function}: shutter must lie within {_FARTHEST:,} frames of the current one, got {shutter!r}"
        )
    return begin, end


def _as_steps(function: str, steps: Any) -> int:
    try:
        if isinstance(steps, (bool, np.bool_)):
            raise TypeError
        count = operator.index(steps)
    except TypeError:
        raise ValueError(f"{function}: steps must be an integer, got {steps!r}") from None
    if not 2 <= count <= MOST_STEPS:
        raise ValueError(f"{function}: steps must be 2 to {MOST_STEPS}, got {count}")
    return count


def place_of(scene: Any) -> Place:
    """Where a scene is, original or evaluated. Before frame 0 Blender counts subframes back, which it does not take."""
    return _as_place(float(scene.frame_current) + float(scene.frame_subframe))


def _as_place(at: float) -> Place:
    frame = math.floor(at)
    subframe = float(np.float32(at - frame))
    return (frame + 1, 0.0) if subframe >= 1.0 else (frame, subframe)


def places_of(shutter: Shutter, times: Sequence[Fraction], here: Place) -> dict[Fraction, Place]:
    """Where the scene is at each moment. here: where it is at the frame itself."""
    return {time: _as_place(here[0] + here[1] + shutter.offset(time)) for time in times}


@contextmanager
def stepping(depsgraph: Any, shutter: Shutter) -> Iterator[Callable[[Place], None]]:
    """Gives a function that goes to a place; in the end everything is as it was.

    depsgraph: what is read. Raises ValueError where going there did not evaluate it.
    """
    scene = depsgraph.scene.original
    here, camera = place_of(scene), scene.camera
    has_gone = False

    def go(place: Place) -> None:
        nonlocal has_gone
        has_gone = True
        _go(scene, shutter, place)
        found = place_of(depsgraph.scene_eval)
        if not _are_same(found, place):
            raise ValueError(
                f"update: frame_set must evaluate the depsgraph that is read at frame {sum(place):g}, got frame "
                f"{sum(found):g}: of a render it is its engine's frame_set, and no handler may change the frame"
            )

    try:
        yield go
    finally:
        if has_gone:
            _return(depsgraph, scene, shutter, here, camera)


def _return(depsgraph: Any, scene: Any, shutter: Shutter, here: Place, camera: Any) -> None:
    """To where the scene was; a second Ctrl-C meanwhile does not leave it half-way."""
    try:
        _go_back(depsgraph, scene, shutter, here, camera)
    except KeyboardInterrupt:
        _go_back(depsgraph, scene, shutter, here, camera)
        raise


def _go_back(depsgraph: Any, scene: Any, shutter: Shutter, here: Place, camera: Any) -> None:
    _go(scene, shutter, here)
    if scene.camera != camera:  # markers chose another one, as they do whenever the frame changes
        scene.camera = camera
    if shutter.frame_set is None:
        depsgraph.update()  # of the camera that markers choose Blender knows when all else is evaluated


def _go(scene: Any, shutter: Shutter, place: Place) -> None:
    frame, subframe = place
    if shutter.frame_set is not None:
        shutter.frame_set(frame, subframe)
    else:
        scene.frame_set(frame, subframe=subframe)


def _are_same(first: Place, second: Place) -> bool:
    """But for what is rounded: what is evaluated has one float32 number for both."""
    rounding = max(1e-6, float(np.spacing(np.float32(abs(first[0]) + 1))))
    return abs((first[0] - second[0]) + (first[1] - second[1])) <= rounding
