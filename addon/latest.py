"""What was done last for each scene, by a render, a preview or a viewport, and whether the scene still is as it was.

Panels that tell of it are drawn again when it changes, without anybody moving the mouse. A render ends on a thread of
its own, from which Blender's interface must not be touched: it only leaves a note, which a timer on the main
thread finds.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import bpy
from bpy.app.handlers import persistent

from .properties import read_settings

if TYPE_CHECKING:
    from .frame import FrameStatistics

TIMER_SECONDS = 0.2

_latest: dict[int, FrameStatistics] = {}  # by the scene's session uid
_edited: set[int] = set()
_is_news = False


def remember(scene: bpy.types.Scene, statistics: FrameStatistics) -> None:
    """What was done last for `scene`, which it shows as it is now; from any thread."""
    global _is_news
    uid = scene.original.session_uid
    _latest[uid] = statistics
    _edited.discard(uid)
    _is_news = True


def confirm_view(scene: bpy.types.Scene) -> None:
    """A viewport has read `scene` again and found nothing else: what was done last for one still holds."""
    global _is_news
    uid = scene.original.session_uid
    if uid in _edited and _latest[uid].source == "Viewport":
        _edited.discard(uid)
        _is_news = True


def last_statistics(scene: bpy.types.Scene) -> FrameStatistics | None:
    """Of what was done last for `scene`, None if nothing was."""
    return _latest.get(scene.session_uid)


def is_outdated(scene: bpy.types.Scene) -> bool:
    """Whether `scene` was edited, set to another frame or given other settings since."""
    statistics = last_statistics(scene)
    return statistics is not None and (
        scene.session_uid in _edited
        or statistics.frame != scene.frame_current_final
        or statistics.settings != read_settings(scene)
    )


def drop_missing(scenes: Iterable[bpy.types.Scene]) -> None:
    """Forgets what was done for scenes that are not among `bpy.data.scenes` any more."""
    there = {scene.session_uid for scene in scenes}
    for uid in [uid for uid in list(_latest) if uid not in there]:
        _latest.pop(uid, None)
        _edited.discard(uid)


def forget() -> None:
    """Forgets all of it."""
    _latest.clear()
    _edited.clear()


@persistent
def _on_update(*arguments: Any) -> None:
    """Blender has evaluated a scene anew. Selecting something is no edit: the depsgraph names the scene alone."""
    global _is_news
    scene, depsgraph = arguments[0], arguments[-1]
    uid = scene.session_uid
    if uid not in _latest or uid in _edited or not isinstance(depsgraph, bpy.types.Depsgraph):
        return
    if any(not isinstance(update.id, bpy.types.Scene) for update in depsgraph.updates):
        _edited.add(uid)
        _is_news = True


def _show_news() -> float:
    global _is_news
    if _is_news:
        _is_news = False
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "PROPERTIES":
                    area.tag_redraw()
    return TIMER_SECONDS


def register() -> None:
    bpy.app.handlers.depsgraph_update_post.append(_on_update)
    if not bpy.app.background:
        bpy.app.timers.register(_show_news, persistent=True)


def unregister() -> None:
    if bpy.app.timers.is_registered(_show_news):
        bpy.app.timers.unregister(_show_news)
    bpy.app.handlers.depsgraph_update_post.remove(_on_update)
    forget()
