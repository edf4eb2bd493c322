"""Tells an engine's scene, before it answers, what has happened in Blender since it was synced."""

from __future__ import annotations

import weakref
from typing import Any

import bpy
from perfect_bvh import Scene

from ..events import asking, changes

Place = tuple[int, str]  # a scene's session uid, and the name of one of its view layers


class SceneWatch:
    """Marks the scene that it follows stale: when Blender tells of a change, and when a query finds out about one.

    Before a query on Blender's main thread Blender evaluates what is pending, and by that tells of it. On other
    threads, inside handlers, drivers and renders it may not be asked: there the scene knows what Blender told before.

    The scene keeps its watch alive, even if the sync is dropped.
    """

    def __init__(self) -> None:
        self._scene: weakref.ref[Scene] | None = None
        self._synced: Place | None = None
        self._active: Place | None = None

    def follow(self, scene: Scene) -> None:
        """Watches over this scene from now on, and no other."""
        self._scene = weakref.ref(scene)
        scene.before_query = self.check

    def start(self) -> None:
        """Listens to Blender until `stop` is called."""
        changes.listen(self)

    def stop(self) -> None:
        changes.stop_listening(self)

    def note_synced(self, depsgraph: Any) -> None:
        """What the scene is about to be equal to."""
        self._synced = (depsgraph.scene.original.session_uid, depsgraph.view_layer.name)
        shown = _shown()
        self._active = None if shown is None else _place_of(shown)

    # What makes it stale ---------------------------------------------------------------------------------------------

    def on_change(self, what: str) -> None:
        """Makes queries raise `perfect_bvh.StaleSceneError` until the next update."""
        scene = None if self._scene is None else self._scene()
        if scene is not None:
            scene.mark_stale(f"{what} since the last update: call update()")

    def on_file_change(self) -> None:
        """The same, for another file."""
        self.on_change("another file was loaded")

    def check(self) -> None:
        """Finds out about what Blender has not told yet. Called before each query that would be answered."""
        if asking.may_ask():
            changes.watch_again()
            self._ask()
        elif asking.is_asking():  # a handler that asks, while Blender evaluates for a query
            self.on_change("something was changed")
        elif not changes.are_installed():
            self.on_change(changes.HANDLERS_REMOVED)

    def _ask(self) -> None:
        shown = _shown()
        if shown is None or self._synced is None:
            return
        active = _place_of(shown)
        view_layer = shown.view_layer if active == self._synced else _find_layer(self._synced)
        if view_layer is None:
            self.on_change("its scene or view layer was removed")
        elif active not in (self._synced, self._active):
            self.on_change("another scene or view layer was shown")
        elif not asking.evaluate_pending(view_layer):
            self.on_change("Blender was asked during an evaluation")


def _shown() -> Any:
    """What shows the active scene and view layer: the window, or the context where there is none."""
    context = bpy.context
    shown = context.window or context
    return shown if shown.scene is not None else None


def _place_of(shown: Any) -> Place:
    return shown.scene.session_uid, shown.view_layer.name


def _find_layer(place: Place) -> Any:
    uid, name = place
    return next((scene.view_layers.get(name) for scene in bpy.data.scenes if scene.session_uid == uid), None)
