"""What was done last for each scene, by a render or of a view, and whether the scene still is as it was.

That is told by the count of a scene's edits (`events/changes.py`), taken when the scene was read. Panels that tell of
it are drawn again when it changes, without anybody moving the mouse. A render ends on a thread of its own, from which
Blender's interface must not be touched: a timer on the main thread finds what is new.

What needs the native engine is imported where it is used: without it the add-on must still register, and say why.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import bpy

from ..events.changes import edit_count, listen, stop_listening
from ..settings.editors import redraw_properties, redraw_sidebars
from ..settings.scene_settings import read_settings

if TYPE_CHECKING:
    from ..sync.report import SyncReport
    from .frame_statistics import FrameStatistics

TIMER_SECONDS = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class _Done:
    """edits: of the scene, when it was read for this."""

    statistics: FrameStatistics
    edits: int


_latest: dict[int, _Done] = {}  # by the scene's session uid
_render_modes: dict[int, str] = {}  # of each scene's last render, whatever its viewports have done since
_image_modes: dict[int, str] = {}  # of the images that views were rendered to, by their session uid
_shown: dict[int, tuple[_Done, bool]] = {}  # as panels have it, with whether the scene was edited since
_has_news = False  # beside that


def edits_of(scene: bpy.types.Scene) -> int:
    """How often `scene` was edited so far: to be asked before it is read, and given to `remember`."""
    return edit_count(scene.original.session_uid)


def remember(scene: bpy.types.Scene, statistics: FrameStatistics, edits: int) -> None:
    """What was done last for `scene` as it was at so many edits; from any thread."""
    uid = scene.original.session_uid
    _latest[uid] = _Done(statistics, edits)
    if statistics.source == "Render":
        _render_modes[uid] = statistics.settings.mode


def confirm_view(scene: bpy.types.Scene, last_change: SyncReport | None) -> None:
    """A viewport has read `scene` again and found nothing else: what was done last for its trees still holds.

    last_change: of the viewport's sync, which says whose trees they are.
    """
    uid = scene.original.session_uid
    done = _latest.get(uid)
    if done is not None and done.statistics.source == "Viewport" and done.statistics.report is last_change:
        _latest[uid] = _Done(done.statistics, edit_count(uid))


def last_statistics(scene: bpy.types.Scene) -> FrameStatistics | None:
    """Of what was done last for `scene`, None if nothing was."""
    done = _latest.get(scene.session_uid)
    return None if done is None else done.statistics


def last_render_mode(scene: bpy.types.Scene) -> str | None:
    """What the last render of `scene` shows, None if there was none."""
    return _render_modes.get(scene.session_uid)


def note_image(image: bpy.types.Image, mode: str) -> None:
    """A view was rendered to this image."""
    _image_modes[image.session_uid] = mode


def image_mode(image: bpy.types.Image) -> str | None:
    """What the view shows that was last rendered to an image, None if none was."""
    return _image_modes.get(image.session_uid)


def is_outdated(scene: bpy.types.Scene) -> bool:
    """Whether `scene` was edited, set to another frame or given other settings since."""
    done = _latest.get(scene.session_uid)
    if done is None:
        return False
    statistics = done.statistics
    is_viewport = statistics.source == "Viewport"
    settings = read_settings(scene, is_viewport=is_viewport)
    if is_viewport or statistics.has_own_mode:
        settings = replace(settings, mode=statistics.settings.mode)
    return (
        done.edits != edits_of(scene)
        or statistics.frame != scene.frame_current_final
        or statistics.settings != settings
    )


def drop_missing(scenes: Iterable[bpy.types.Scene]) -> None:
    """Forgets what was done for scenes that are not among `bpy.data.scenes` any more."""
    there = {scene.session_uid for scene in scenes}
    for uid in [uid for uid in list(_latest) if uid not in there]:
        _latest.pop(uid, None)
        _render_modes.pop(uid, None)


def forget() -> None:
    """Forgets all of it."""
    _latest.clear()
    _render_modes.clear()
    _image_modes.clear()


def tell_of_news() -> None:
    """Panels show something of a scene that is not kept here, and it has changed; from any thread."""
    global _has_news
    _has_news = True


def _show_news() -> float:
    global _shown, _has_news
    before, _shown = _shown, {uid: (done, done.edits != edit_count(uid)) for uid, done in _latest.copy().items()}
    if _shown != before or _has_news:
        _has_news = False
        redraw_properties()
        redraw_sidebars()
    return TIMER_SECONDS


class _FileWatcher:
    """What was done for a scene is forgotten with it, or with its file."""

    def on_change(self, what: str) -> None:
        drop_missing(bpy.data.scenes)

    def on_file_change(self) -> None:
        forget()


_watcher = _FileWatcher()


def register() -> None:
    listen(_watcher)
    if not bpy.app.background:
        bpy.app.timers.register(_show_news, persistent=True)


def unregister() -> None:
    stop_listening(_watcher)
    if bpy.app.timers.is_registered(_show_news):
        bpy.app.timers.unregister(_show_news)
    forget()
