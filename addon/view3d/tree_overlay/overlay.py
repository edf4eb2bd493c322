"""The boxes of the trees, drawn over 3D viewports: the top level, and the tree of the active object.

Each scene's view layer has an overlay of its own (`scene_overlay.py`) for as long as it asks for one.
"""

from __future__ import annotations

import bpy

from ...settings.preferences import native_error, redraw_viewports
from .. import pointer
from ..legend import DrawHandler, Section
from .scene_overlay import SceneOverlay

_overlays: dict[tuple[int, str], SceneOverlay] = {}


def overlay_of(context: bpy.types.Context) -> SceneOverlay | None:
    """What is drawn of the context's scene, for the panel to tell of it; None if nothing is."""
    return _overlays.get((context.scene.session_uid, context.view_layer.name))


def is_wanted(context: bpy.types.Context) -> bool:
    """Whether the context's scene asks for boxes, and can have them: not while a ray is walked, which shows its own."""
    settings = context.scene.perfect_bvh.overlay
    if not (settings.show_top_level or settings.show_active) or native_error() is not None:
        return False
    from ..walk import walk_view

    return walk_view.shown_in(context) is None


def _draw() -> None:
    context = bpy.context
    key = (context.scene.session_uid, context.view_layer.name)
    if not is_wanted(context):
        _drop(key)
        return
    if not context.space_data.overlay.show_overlays:
        return
    if key not in _overlays:
        from ...events.changes import listen

        there = {scene.session_uid for scene in bpy.data.scenes}
        for gone in [other for other in _overlays if other[0] not in there]:
            _drop(gone)
        _overlays[key] = SceneOverlay()
        listen(_overlays[key])
    _overlays[key].draw(context, context.scene.perfect_bvh.overlay)


def sections(context: bpy.types.Context) -> list[Section]:
    """What a viewport's legend is to tell of the boxes."""
    overlay = overlay_of(context) if context.space_data.overlay.show_overlays else None
    return [] if overlay is None else overlay.sections(context.scene.perfect_bvh.overlay)


def tip(context: bpy.types.Context) -> tuple[tuple[int, int], list[str]] | None:
    """Where the mouse is in the region that is being drawn, and what is told of the box there."""
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


def _drop(key: tuple[int, str]) -> None:
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
    """Draw no more, and forget what was drawn."""
    pointer.listeners.remove(_pointing)
    _handler.remove()
    if bpy.app.timers.is_registered(redraw_viewports):
        bpy.app.timers.unregister(redraw_viewports)
    for key in list(_overlays):
        _drop(key)
