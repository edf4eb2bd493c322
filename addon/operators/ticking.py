"""Operators in a window that work in steps of a timer: Blender goes on, and its status bar tells how far they are."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from ..statistics import messages
from ..statistics.words import sentence
from . import status_bar

TIMER_SECONDS = 0.01
# Whose names errors begin with, for scripts.
FUNCTIONS = ("scan", "bench", "compare")


def sentence_of(problem: BaseException | str) -> str:
    """What users read of it: neither a function's name nor a number of the operating system's."""
    text = problem.strerror if isinstance(problem, OSError) and problem.strerror else str(problem)
    for function in FUNCTIONS:
        text = text.removeprefix(f"{function}: ")
    return sentence(text or type(problem).__name__)


class Ticking:
    """What such operators share: a timer that calls their `modal`, a bar at the pointer, a line in the status bar.

    Without a window, or when a script calls them, none of it begins.
    """

    bl_label: str
    report: Callable[[set[str], str], None]
    _timer: bpy.types.Timer | None = None
    _told = ""

    def _begin_ticking(self, context: bpy.types.Context) -> None:
        manager = context.window_manager
        self._timer = manager.event_timer_add(TIMER_SECONDS, window=context.window)
        manager.progress_begin(0, 100)
        manager.modal_handler_add(self)

    def _tell(self, context: bpy.types.Context, state: str) -> None:
        """Shows a line until the end, or the next."""
        if state != self._told:  # each call draws the status bar again
            self._told = state
            status_bar.tell(context, state)

    def _forget_complaints(self) -> None:
        """It begins anew."""
        messages.tell(bpy.context.scene, self.bl_label)

    def _complain(self, problem: BaseException | str, kind: str = "ERROR") -> None:
        """Report what went wrong, and leave it in the panels until it begins anew."""
        text = sentence_of(problem)
        self.report({kind}, text)
        messages.add(bpy.context.scene, self.bl_label, text, is_error=kind == "ERROR")

    def _end_ticking(self, context: bpy.types.Context) -> None:
        """Nothing if it has not begun, or ended before."""
        if self._timer is None:
            return
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        status_bar.clear(context)
        self._timer = None
