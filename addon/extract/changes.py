"""Tells whoever listens that Blender has evaluated something, changed the frame, undone a step or loaded a file.

Blender's handlers are installed with the first listener and removed when the last one stops listening. Listeners are
held weakly: a forgotten one costs nothing but handlers that tell nobody. A handler does nothing else: what to do about
a change is the listener's business, and it must be little. Nor may it remove itself: Blender goes through its list by
number, and would pass over the handler that comes next.
"""

from __future__ import annotations

import weakref
from typing import Any, Protocol

import bpy
from bpy.app.handlers import persistent


class ChangeListener(Protocol):
    """Whoever wants to know."""

    def on_change(self, what: str) -> None:
        """Called on Blender's main thread after each change. what: a clause for a message."""

    def on_file_change(self) -> None:
        """Called when all data-blocks are about to go, or have just come."""


_listeners: weakref.WeakSet[Any] = weakref.WeakSet()


def listen(listener: ChangeListener) -> None:
    """Tells the listener of every change from now on, for as long as it lives."""
    _listeners.add(listener)
    _install()


def stop_listening(listener: ChangeListener) -> None:
    """Tells it no more."""
    _listeners.discard(listener)
    if not _listeners:
        _remove()


def _announce(what: str) -> None:
    for listener in tuple(_listeners):
        listener.on_change(what)


# Blender calls these with the scene (or the file's path) and, mostly, the depsgraph; versions differ in how many.


@persistent
def _on_depsgraph_update(*_: Any) -> None:
    _announce("the scene was evaluated again")


@persistent
def _on_frame_change(*_: Any) -> None:
    _announce("the frame was changed")


@persistent
def _on_undo(*_: Any) -> None:
    _announce("a step was undone")


@persistent
def _on_redo(*_: Any) -> None:
    _announce("a step was redone")


@persistent
def _on_load(*_: Any) -> None:
    for listener in tuple(_listeners):
        listener.on_file_change()


_HANDLERS = (
    ("depsgraph_update_post", _on_depsgraph_update),
    ("frame_change_post", _on_frame_change),
    ("undo_post", _on_undo),
    ("redo_post", _on_redo),
    ("load_pre", _on_load),
    ("load_post", _on_load),
)


def _install() -> None:
    for name, handler in _HANDLERS:
        handlers = getattr(bpy.app.handlers, name)
        if handler not in handlers:
            handlers.append(handler)


def _remove() -> None:
    for name, handler in _HANDLERS:
        handlers = getattr(bpy.app.handlers, name)
        if handler in handlers:
            handlers.remove(handler)
