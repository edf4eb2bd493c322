"""A function that Blender calls whenever it draws the main region of one kind of editor."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy


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
