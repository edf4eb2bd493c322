"""Refines one image after the other on a thread of its own, which is there only while there is something to trace.

What it is given to trace holds nothing of Blender, so Blender goes on meanwhile, and may edit what is traced. All
methods are for one thread, `stop` for any. Knows no Blender.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

from ..support.background_work import BackgroundWork
from .refinement import Refinement

if TYPE_CHECKING:
    from perfect_bvh import StopFlag

# The first image of a view is awaited: it is made so coarse that it is there at once.
FIRST_SECONDS = 0.03
LOOKING_SECONDS = 0.05


class Tracer:
    """Works on nothing at first. It keeps no thread alive, and a thread does not keep it."""

    def __init__(self) -> None:
        self._refinement: Refinement | None = None
        self._work: BackgroundWork[None, None] | None = None
        self._stop: StopFlag | None = None

    def trace(self, refinement: Refinement) -> None:
        """Go on with an image until it is finished or `stop`, and with no other; does nothing if that is so already."""
        import perfect_bvh

        if self._refinement is refinement and self._work is not None and (self.is_running or self.problem is not None):
            return
        self.stop()
        before, stop = self._work, perfect_bvh.make_stop_flag()
        self._refinement, self._stop = refinement, stop
        self._work = BackgroundWork(
            lambda _: _trace(refinement, stop, before), finish=lambda _: None, when_stopped=stop.set
        )

    def stop(self) -> None:
        """Trace no more, from any thread; it waits for nothing. What was traced so far stays with the image."""
        work = self._work
        if work is not None:
            work.ask_to_stop()

    def wait_for_image(self, seconds: float = math.inf) -> None:
        """Until there is anything to show or nothing is traced, at most so long."""
        refinement, until = self._refinement, time.monotonic() + seconds
        while refinement is not None and self.is_running:
            left = min(until - time.monotonic(), LOOKING_SECONDS)
            if left <= 0.0 or refinement.canvas.has_image.wait(left):
                return

    @property
    def is_running(self) -> bool:
        """Whether it is at work, and was not asked to stop."""
        return self._work is not None and self._work.is_running and self._work.is_wanted

    @property
    def problem(self) -> BaseException | None:
        """Why the image is not traced any further, if it should be."""
        if self._work is None or self._work.is_running:
            return None
        try:
            self._work.result()
        except Exception as problem:  # noqa: BLE001 - handed on
            return problem
        return None


def _trace(refinement: Refinement, stop: StopFlag, before: BackgroundWork[None, None] | None) -> None:
    """What the thread does. before: what has to end first."""
    import perfect_bvh

    if before is not None:
        before.settle()
    before = None
    try:
        while not refinement.is_finished and not stop.is_set:
            has_image = refinement.canvas.has_image.is_set()
            refinement.step(refinement.interval if has_image else FIRST_SECONDS, stop)
    except perfect_bvh.Cancelled:
        return  # not handed on: what is raised holds on to all that it has come through
