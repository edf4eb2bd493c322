"""Operators in a window that work in steps of a timer: Blender goes on, and its status bar tells how far they are."""

from __future__ import annotations

import bpy

TIMER_SECONDS = 0.01


class Ticking:
    """What such operators share: a timer that calls their `modal`, a bar at the pointer, a line in the status bar.

    Without a window, or when a script calls them, none of it begins.
    """

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
            context.workspace.status_text_set(state)

    def _end_ticking(self, context: bpy.types.Context) -> None:
        """Nothing if it has not begun, or ended before."""
        if self._timer is None:
            return
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        self._timer = None
