"""Notifies its listeners that Blender has evaluated something, changed the frame, undone a step or loaded a file.

Also keeps the log of evaluations, see `asking.py`, and counts the edits of each scene, while there are
listeners.

Blender's handlers are installed with the first listener and removed when the last one stops listening. Listeners are
held weakly: a dropped one costs nothing but handlers without a listener. Handlers only notify: the listener decides
what to do about a change, which must be fast. A handler must not remove itself: Blender iterates over its list by
index, and would skip the next handler.

Listeners are also notified when an evaluation, a frame change or an undo begins. Queries of other handlers and drivers
during it must not be answered from the old state. `asking.py` explains why the end must be known, too.
"""

from __future__ import annotations

import weakref
from collections import Counter
from typing import Any, Protocol

import bpy
from bpy.app.handlers import persistent

from . import asking
from .asking import EvaluationLog

# Finds the evaluations that are caused by an edit.
#
# A selection evaluates only the scene. When a screen is removed, as an editor is no longer maximized or a window is
# closed, Blender reports the scene and all of its objects, as if their shading had changed. Edits of an object's
# settings look nearly the same, so the screens are compared to distinguish the two.


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


_passed_over: dict[int, set[str]] = {}  # view layers evaluated since `pass_over`, by the scene's session uid


def pass_over(scene: bpy.types.Scene, layer: bpy.types.ViewLayer | None = None) -> None:
    """Has each view layer's next evaluation not counted as an edit, as a job sets the frame or lends a camera.

    layer: is evaluated now, so that edits before are counted. Without windows, no one edits at the same time.
    """
    if layer is not None and not bpy.app.background:
        layer.update()
    _passed_over[scene.session_uid] = set()


def _is_passed_over(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> bool:
    evaluated, layer = _passed_over.get(scene.session_uid), depsgraph.view_layer.name
    if evaluated is None or layer in evaluated:
        return False
    if not any(isinstance(update.id, bpy.types.Scene) for update in depsgraph.updates):
        return False  # a user's edit of an object came first
    evaluated.add(layer)
    return True


# Changes -------------------------------------------------------------------------------------------------------------


class ChangeListener(Protocol):
    """A listener to changes."""

    def on_change(self, what: str) -> None:
        """Called on Blender's main thread after each change. what: a clause for a message."""

    def on_file_change(self) -> None:
        """Called when all data-blocks are about to go, or have just come."""


FRAME_CHANGED = "the frame was changed"
HANDLERS_REMOVED = "Blender's handlers were removed"

_listeners: weakref.WeakSet[Any] = weakref.WeakSet()
_log = EvaluationLog()
_edit_counts: Counter[int] = Counter()  # by the scene's session uid
_gap_count = 0  # how often Blender's handlers were found to be missing


def listen(listener: ChangeListener) -> None:
    """Notifies the listener of every change from now on, while it exists."""
    watch_again()
    _listeners.add(listener)
    _install()


def stop_listening(listener: ChangeListener) -> None:
    """Stops notifying it."""
    _listeners.discard(listener)
    if not _listeners:
        _remove()


def watched_evaluations(depsgraph: Any) -> EvaluationLog | None:
    """Returns the log of evaluations, None without a listener: then none are recorded.

    depsgraph: the one that will be read. Within a handler it may name changes that are not in the log yet.
    """
    if not _listeners:
        return None
    watch_again()
    _log.add(depsgraph)
    return _log


def watch_again() -> None:
    """Restores handlers that another script has removed; listeners learn that they may have missed changes.

    Called before a scene is read, or a reading is shown.
    """
    global _gap_count
    if _listeners and not are_installed():
        _install()
        asking.forget_all()
        _gap_count += 1
        _announce(HANDLERS_REMOVED)


def are_installed() -> bool:
    """Whether Blender still calls all that it was asked to call. Scripts empty its lists."""
    return all(handler in handlers for handlers, handler in _PLACES)


def edit_count(scene_uid: int) -> int:
    """Returns the number of observed edits of a scene. Evaluations of renders are no edits.

    Neither are frame changes, which have other handlers, nor the evaluations that the section on edits excludes.
    """
    return _edit_counts[scene_uid] + _gap_count


def _announce(what: str) -> None:
    for listener in _told():
        listener.on_change(what)


def _told() -> list[Any]:
    """Returns a copy of all listeners, as a render's thread may notify while the main thread adds listeners."""
    return [listener for reference in _listeners.data.copy() if (listener := reference()) is not None]


# Blender calls these with the scene (or the file's path) and, mostly, the depsgraph; versions differ in how many.


def _note(arguments: tuple[Any, ...]) -> None:
    depsgraph = arguments[1] if len(arguments) > 1 else None
    if isinstance(depsgraph, bpy.types.Depsgraph):
        _log.add(depsgraph)
    else:
        _log.forget()


@persistent
def _before_evaluation(*_: Any) -> None:
    asking.begin("evaluation")
    _move_to_the_end("depsgraph_update_post", _after_evaluation)
    _announce("the scene was evaluated again")


@persistent
def _on_depsgraph_update(*arguments: Any) -> None:
    _note(arguments)
    scene, depsgraph = arguments[0], arguments[-1]
    if isinstance(depsgraph, bpy.types.Depsgraph):
        is_ours = _is_passed_over(scene, depsgraph)
        if is_edit(depsgraph) and not is_ours:
            _edit_counts[scene.session_uid] += 1
    _announce("the scene was evaluated again")


@persistent
def _after_evaluation(*_: Any) -> None:
    asking.end("evaluation")


@persistent
def _before_frame_change(*_: Any) -> None:
    asking.begin("frame change")
    _move_to_the_end("frame_change_post", _after_frame_change)
    _announce(FRAME_CHANGED)


@persistent
def _on_frame_change(*arguments: Any) -> None:
    _note(arguments)
    scene, depsgraph = arguments[0], arguments[-1]
    if isinstance(depsgraph, bpy.types.Depsgraph) and depsgraph.mode == "VIEWPORT":
        _passed_over.pop(scene.session_uid, None)
    _announce(FRAME_CHANGED)


@persistent
def _after_frame_change(*_: Any) -> None:
    asking.end("frame change")


@persistent
def _before_render(*_: Any) -> None:
    asking.begin("render")


@persistent
def _after_render(*_: Any) -> None:
    asking.end("render")


@persistent
def _on_undo(*_: Any) -> None:
    _log.forget()
    _announce("a step was undone")


@persistent
def _on_redo(*_: Any) -> None:
    _log.forget()
    _announce("a step was redone")


@persistent
def _on_load(*_: Any) -> None:
    _log.forget()
    _passed_over.clear()
    for listener in _told():
        listener.on_file_change()


_FIRST = (  # of Blender's handlers, so that no other handler queries before listeners are notified
    ("depsgraph_update_pre", _before_evaluation),
    ("frame_change_pre", _before_frame_change),
    ("undo_pre", _on_undo),
    ("redo_pre", _on_redo),
    ("load_pre", _on_load),
    ("render_init", _before_render),
)
_HANDLERS = (
    *_FIRST,
    ("depsgraph_update_post", _on_depsgraph_update),
    ("frame_change_post", _on_frame_change),
    ("undo_post", _on_undo),
    ("redo_post", _on_redo),
    ("load_post", _on_load),
    ("depsgraph_update_post", _after_evaluation),
    ("frame_change_post", _after_frame_change),
    ("render_complete", _after_render),
    ("render_cancel", _after_render),
)
_PLACES = tuple((getattr(bpy.app.handlers, name), handler) for name, handler in _HANDLERS)  # Blender's very lists


def _install() -> None:
    """Adds missing handlers; the log then lacks earlier events."""
    for entry in _HANDLERS:
        name, handler = entry
        handlers = getattr(bpy.app.handlers, name)
        if handler not in handlers:
            handlers.insert(0 if entry in _FIRST else len(handlers), handler)
            _log.forget()


def _move_to_the_end(name: str, handler: Any) -> None:
    """Behind the handlers that others have installed since. Only before Blender goes through that list."""
    handlers = getattr(bpy.app.handlers, name)
    if asking.is_main_thread() and handler in handlers and handlers[-1] is not handler:
        handlers.remove(handler)
        handlers.append(handler)


def _remove() -> None:
    for name, handler in _HANDLERS:
        handlers = getattr(bpy.app.handlers, name)
        if handler in handlers:
            handlers.remove(handler)
    asking.forget_all()
