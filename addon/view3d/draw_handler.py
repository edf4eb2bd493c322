"""What draws over editors: functions that Blender calls for each main region, and what a tool shows by them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

import bpy

from ..events.changes import listen, stop_listening
from ..settings.editors import redraw_viewports

T = TypeVar("T")


class DrawHandler:
    """Draws from `add` to `remove`.

    draw: finds what it draws into in `bpy.context`.
    when: "POST_VIEW" to draw in the scene's units, "POST_PIXEL" in the region's pixels.
    space: the kind of editor.
    """

    def __init__(self, draw: Callable[[], None], when: str, space: Any = bpy.types.SpaceView3D) -> None:
        self._draw, self._when, self._space = draw, when, space
        self._handle: Any = None

    def add(self) -> None:
        self._handle = self._space.draw_handler_add(self._draw, (), "WINDOW", self._when)

    def remove(self) -> None:
        self._space.draw_handler_remove(self._handle, "WINDOW")
        self._handle = None


class OneShown(Generic[T]):
    """What a tool shows over 3D viewports, one thing at a time: until `hide`, or until another file is there.

    found: it, None where nothing is shown.
    """

    def __init__(self) -> None:
        self.found: T | None = None

    def show(self, what: T) -> None:
        """Show it instead of what is shown."""
        self.hide()
        listen(self)
        self.found = what
        redraw_viewports()

    def hide(self) -> None:
        """Show nothing any more; does nothing where nothing is shown."""
        if self.found is None:
            return
        self.found = None
        stop_listening(self)
        self.forget()
        redraw_viewports()

    def forget(self) -> None:
        """What was kept of it goes."""

    def on_change(self, what: str) -> None:
        """It stays as it is."""

    def on_file_change(self) -> None:
        self.hide()
