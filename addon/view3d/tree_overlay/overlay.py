"""The boxes of the trees, drawn over 3D viewports: the top level, and the tree of the active object.

Each viewport has a separate overlay (`scene_overlay.py`) for each view layer that it shows, while it needs
one.
"""

from __future__ import annotations

import bpy

from ...settings.preferences import native_error, redraw_viewports
from ...settings.shading_settings import overlay_settings
from .. import pointer
from ..legend import DrawHandler, Section
from .scene_overlay import SceneOverlay

# The address of a viewport's space, a scene's session_uid, the name of its view layer.
Key = tuple[int, int, str]
_overlays: dict[Key, SceneOverlay] = {}


def _key_of(context: bpy.types.Context) -> Key:
    return context.space_data.as_pointer(), context.scene.session_uid, context.view_layer.name


def overlay_of(context: bpy.types.Context) -> SceneOverlay | None:
    """Return the overlay of the context's viewport; None if there is none."""
    return _overlays.get(_key_of(context))


def is_wanted(context: bpy.types.Context) -> bool:
    """Whether the context's viewport asks for boxes, and can have them: not while a walk of a ray shows its own."""
    settings = overlay_settings(context.space_data)
    if not (settings.show_top_level or settings.show_active) or native_error() is not None:
        return False
    from ..walk import walk_view

    return walk_view.shown_in(context) is None


def _draw() -> None:
    context = bpy.context
    key = _key_of(context)
    if not is_wanted(context):
        _drop(key)
        return
    if not context.space_data.overlay.show_overlays:
        return
    if key not in _overlays:
        from ...events.changes import listen

        for gone in [other for other in _overlays if not _is_there(other)]:
            _drop(gone)
        _overlays[key] = SceneOverlay()
        listen(_overlays[key])
    _overlays[key].draw(context, overlay_settings(context.space_data))


def _is_there(key: Key) -> bool:
    """Whether the viewport and the scene are."""
    windows = bpy.context.window_manager.windows
    spaces = (area.spaces.active for window in windows for area in window.screen.areas)
    is_scene_there = any(scene.session_uid == key[1] for scene in bpy.data.scenes)
    return is_scene_there and any(space.as_pointer() == key[0] for space in spaces)


def sections(context: bpy.types.Context) -> list[Section]:
    """Return the sections of a viewport's legend that describe the boxes."""
    overlay = overlay_of(context) if context.space_data.overlay.show_overlays else None
    return [] if overlay is None else overlay.sections(overlay_settings(context.space_data))


def tip(context: bpy.types.Context) -> tuple[tuple[int, int], list[str]] | None:
    """Return the mouse's position in the region that is being drawn, and the tip about the box there."""
    overlay = overlay_of(context) if context.space_data.overlay.show_overlays else None
    return None if overlay is None else overlay.tip(context)


class _Pointing:
    """The mouse, as the overlays hear of it."""

    def wants_pointer(self, context: bpy.types.Context) -> bool:
        return is_wanted(context) and context.space_data.overlay.show_overlays

    def on_pointer(self, context: bpy.types.Context, place: tuple[int, int]) -> None:
        overlay = overlay_of(context)
        if overlay is not None:
            overlay.point(context, place)

    def on_pointer_left(self) -> None:
        for overlay in _overlays.values():
            overlay.point(bpy.context, None)


_pointing = _Pointing()


def _drop(key: Key) -> None:
    overlay = _overlays.pop(key, None)
    if overlay is not None:
        from ...events.changes import stop_listening

        stop_listening(overlay)


_handler = DrawHandler(_draw, "POST_VIEW")


def register() -> None:
    """Draw over every 3D viewport from now on, where the scene asks for it."""
    _handler.add()
    pointer.listeners.append(_pointing)


def unregister() -> None:
    """Stop drawing, and drop the overlays."""
    pointer.listeners.remove(_pointing)
    _handler.remove()
    if bpy.app.timers.is_registered(redraw_viewports):
        bpy.app.timers.unregister(redraw_viewports)
    for key in list(_overlays):
        _drop(key)
