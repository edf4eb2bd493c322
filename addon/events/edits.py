"""Which evaluations come of an edit.

A selection evaluates the scene alone. When a screen goes, as an editor is no longer maximized or a window is closed,
Blender names the scene and all of its objects, as if their shading had changed. Edits of an object's settings look
nearly like that, so the screens tell which of the two it was.
"""

from __future__ import annotations

from typing import Any

import bpy

_screens: frozenset[int] = frozenset()  # the addresses of those that were shown at the last evaluation


def is_edit(depsgraph: Any) -> bool:
    """Whether something of the scene was edited. To be asked after each evaluation, and once only."""
    global _screens
    before, _screens = _screens, shown_screens()
    has_lost_screen = not before <= _screens
    if all(isinstance(update.id, bpy.types.Scene) for update in depsgraph.updates):
        return False
    return not (has_lost_screen and _is_shown_anew(depsgraph))


def shown_screens() -> frozenset[int]:
    """The addresses of all windows' screens."""
    manager = bpy.context.window_manager
    return frozenset() if manager is None else frozenset(window.screen.as_pointer() for window in manager.windows)


def _is_shown_anew(depsgraph: Any) -> bool:
    is_scene_named = False
    for update in depsgraph.updates:
        if update.is_updated_transform or update.is_updated_geometry:
            return False
        if isinstance(update.id, bpy.types.Scene):
            is_scene_named = True
        elif not isinstance(update.id, bpy.types.Object):
            return False
    return is_scene_named
