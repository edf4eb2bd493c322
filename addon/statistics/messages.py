"""The last errors of each scene, kept until a newer result.

Blender shows reports for a few seconds only. `not_shown.py` lists what an image could not show.
This module keeps the errors that stopped an image, a scan or a measurement, and complaints of an image's statistics.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass

import bpy

from ..events.changes import listen, stop_listening
from .last_result import last_statistics, tell_of_news

# What problems are of. A render is the next image after a view of which one was made.
RENDER, VIEWPORT, VIEW = "Render", "Viewport", "Render View to Image"


@dataclass(frozen=True, slots=True)
class Message:
    """source: its origin. text: a sentence, with advice. is_error: whether there is no result.

    is_note: whether it is no problem; such a message is only shown by the panel of its source.
    """

    source: str
    text: str
    is_error: bool = False
    is_note: bool = False


_of_views: weakref.WeakKeyDictionary[object, tuple[int, Message]] = weakref.WeakKeyDictionary()  # with the scene's uid
_told: dict[int, dict[str, tuple[Message, ...]]] = {}  # by the scene's session uid, and by what they are of


def tell(scene: bpy.types.Scene, source: str, *texts: str, is_error: bool = False) -> None:
    """Replaces the last errors of an action for `scene`, if any, by new ones; from any thread."""
    of_scene = _told.setdefault(scene.original.session_uid, {})
    messages = tuple(Message(source, text, is_error) for text in texts)
    if of_scene.get(source, ()) != messages:
        of_scene[source] = messages
        tell_of_news()


def add(scene: bpy.types.Scene, source: str, text: str, *, is_error: bool = False, is_note: bool = False) -> None:
    """Adds a message to the existing ones."""
    of_scene = _told.setdefault(scene.original.session_uid, {})
    of_scene[source] = (*of_scene.get(source, ()), Message(source, text, is_error, is_note))
    tell_of_news()


def notes_of(scene: bpy.types.Scene, source: str) -> tuple[str, ...]:
    """Returns the notes on the last action."""
    return tuple(message.text for message in _told.get(scene.session_uid, {}).get(source, ()) if message.is_note)


def tell_of_view(scene: bpy.types.Scene, view: object, text: str | None, *, is_error: bool = False) -> None:
    """Sets the problem of one viewport that shows `scene`, None for no problem; on the main thread.

    view: the owner, which keeps the message while it exists. Nothing else removes it.
    """
    before = _of_views.get(view)
    told = (scene.original.session_uid, Message(VIEWPORT, text, is_error)) if text else None
    if told == before:
        return
    if told is None:
        del _of_views[view]
    else:
        _of_views[view] = told
        if before is None:
            weakref.finalize(view, tell_of_news).atexit = False
    tell_of_news()


def begin_render(scene: bpy.types.Scene) -> None:
    """Drops messages of earlier renders."""
    for source in (RENDER, VIEW):
        tell(scene, source)


def messages_of(scene: bpy.types.Scene) -> tuple[Message, ...]:
    """Returns all messages of a scene except notes, the most severe first, each once."""
    told = [message for each in list(_told.get(scene.session_uid, {}).values()) for message in each]
    found = [message for message in told if not message.is_note]
    found += [message for uid, message in list(_of_views.values()) if uid == scene.session_uid]
    found.sort(key=lambda message: not message.is_error)
    statistics = last_statistics(scene)
    if statistics is not None:
        listed = {str(row) for row in statistics.report.not_shown}
        texts = (*statistics.report.warnings, *statistics.complaints)
        found += [Message(statistics.source, text) for text in texts if text not in listed]
    return tuple({message.text: message for message in reversed(found)}.values())[::-1]


class _FileWatcher:
    """Drops messages with their scene, or with its file."""

    def on_change(self, what: str) -> None:
        there = {scene.session_uid for scene in bpy.data.scenes}
        for uid in [uid for uid in list(_told) if uid not in there]:
            _told.pop(uid, None)

    def on_file_change(self) -> None:
        _told.clear()
        _of_views.clear()


_watcher = _FileWatcher()


def register() -> None:
    listen(_watcher)


def unregister() -> None:
    stop_listening(_watcher)
    _told.clear()
    _of_views.clear()
