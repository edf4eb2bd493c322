"""When viewports are drawn again, without anybody moving the mouse: when there is something new, and not too often.

A redraw takes the processor from the tracer, without a graphics card most of a tenth of a second. So what redraws cost
is measured, and there is a pause of several times that after each. All of this is on Blender's main thread, in a timer
that runs only while a viewport works on its image. What ends is shown at once, and so is what was denoised: that comes
seldom, whenever samples have doubled, and is much better than what it replaces.
"""

from __future__ import annotations

import time
import weakref
from dataclasses import dataclass
from typing import Protocol

import bpy

from ...events.changes import listen, stop_listening

# Of all time, what redraws for the sake of new images may take.
SHARE = 0.1
LONGEST_PAUSE = 3.0  # after a redraw that took very long for once
TICK_SECONDS = 0.02
# A region that is hidden is not drawn, however often that is asked for.
ASKING_SECONDS = 1.0


@dataclass(slots=True)
class RedrawBudget:
    """How often to redraw, from what the last one cost. Times are of any clock that only goes forward."""

    pause: float = 0.0
    """Seconds that lie between two redraws."""
    _begun: float | None = None
    _ended: float = float("-inf")

    def begin(self, now: float) -> None:
        """A redraw was asked for."""
        self._begun = now

    def end(self, now: float) -> None:
        """It is over, if one was under way."""
        if self._begun is None:
            return
        self.pause = min((now - self._begun) * (1.0 / SHARE - 1.0), LONGEST_PAUSE)
        self._begun, self._ended = None, now

    def allows(self, now: float) -> bool:
        """Whether it is time for another."""
        return self._begun is None and now >= self._ended + self.pause


class Traced(Protocol):
    """A viewport, as far as redraws are concerned. asked_at: when a redraw of it was last asked for."""

    asked_at: float

    @property
    def region_pointer(self) -> int:
        """The address of what is drawn."""

    @property
    def is_working(self) -> bool:
        """Whether more of its image is to come."""

    @property
    def has_news(self) -> bool:
        """Whether its image is better than what was drawn."""

    @property
    def is_denoised(self) -> bool:
        """Whether it is one without noise."""

    @property
    def has_ended(self) -> bool:
        """Whether it is as good as it gets."""

    def stop(self) -> None:
        """Have it traced no further; from any thread."""

    def visits_at(self, place: tuple[int, int]) -> tuple[int, int] | None:
        """What the camera ray through a pixel of the region visits: nodes, and triangles; None outside the image."""


budget = RedrawBudget()
_viewports: weakref.WeakSet[Traced] = weakref.WeakSet()


def watch(viewport: Traced) -> None:
    """It works on its image: it is drawn again when there is news of that, and for as long as it exists."""
    _viewports.add(viewport)
    if not bpy.app.background and not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=TICK_SECONDS, persistent=True)


def viewport_at(region_pointer: int) -> Traced | None:
    """The viewport that was drawn into a region last, by the address of that."""
    found = [viewport for viewport in _viewports if viewport.region_pointer == region_pointer]
    return found[0] if len(found) == 1 else None


def _tick() -> float | None:
    now = time.perf_counter()
    budget.end(now)  # Blender draws between two looks of a timer
    working = [viewport for viewport in _viewports if viewport.is_working]
    if not working:
        return None
    if _is_playing():  # the next frame comes by itself
        return TICK_SECONDS
    news = [viewport for viewport in working if viewport.has_news and now >= viewport.asked_at + ASKING_SECONDS]
    if not news or not (budget.allows(now) or any(viewport.has_ended or viewport.is_denoised for viewport in news)):
        return TICK_SECONDS
    regions = {viewport.region_pointer for viewport in news}
    for viewport in news:
        viewport.asked_at = now
    if _tag(regions):
        budget.begin(now)
        return 0.0
    return TICK_SECONDS


def _is_playing() -> bool:
    return any(window.screen.is_animation_playing for window in bpy.context.window_manager.windows)


def _tag(regions: set[int]) -> bool:
    """Have regions drawn, by their addresses; whether any of them is there."""
    found = False
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            for region in area.regions if area.type == "VIEW_3D" else ():
                if region.as_pointer() in regions:
                    region.tag_redraw()
                    found = True
    return found


def stop_all() -> None:
    """Have no viewport trace any more, until it is drawn again; from any thread."""
    for viewport in _viewports.copy():
        viewport.stop()


class _Watcher:
    """What was undone, or goes with its file, is traced no further."""

    def on_change(self, what: str) -> None:
        if what in {"a step was undone", "a step was redone"}:
            stop_all()

    def on_file_change(self) -> None:
        stop_all()


_watcher = _Watcher()


def register() -> None:
    listen(_watcher)


def unregister() -> None:
    stop_listening(_watcher)
    stop_all()
    _viewports.clear()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
