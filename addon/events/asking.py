"""Evaluations of Blender: requests for them, and their log."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Any

import bpy

# Makes Blender evaluate pending changes, where that is allowed.
#
# It is allowed on Blender's main thread, outside of evaluations and of renders, and while Python may use its context.
# Inside a handler or a driver it would enter the running evaluation a second time; a render reads the same
# data on another thread. `changes.py` reports when evaluations and renders begin and end.


_Context = bpy.types.Context  # looking it up is slow
_under_way: set[str] = set()  # of what goes on inside Blender on the main thread


def begin(what: str) -> None:
    """Blender is at it until `end` is called."""
    if is_main_thread():
        _under_way.add(what)


def end(what: str) -> None:
    if is_main_thread():
        _under_way.discard(what)


def forget_all() -> None:
    """Resets the counts, for when an end may have been missed."""
    _under_way.clear()


def is_main_thread() -> bool:
    return threading.get_ident() == threading.main_thread().ident


def may_ask() -> bool:
    """Whether an evaluation may be requested here and now; a render in a window runs on another thread, as a job."""
    return (
        is_main_thread()
        and not _under_way
        and isinstance(bpy.context, _Context)  # restricted while add-ons register
        and not is_render_job_running()
    )


def is_render_job_running() -> bool:
    """Whether a window's render is under way; for any thread."""
    return bool(bpy.app.is_job_running("RENDER"))


def evaluate_pending(view_layer: Any) -> bool:
    """Evaluates pending changes of a `bpy.types.ViewLayer`; without any, it costs a microsecond.

    False if Blender refuses, as it does while a driver is evaluated. (`evaluated_depsgraph_get` would wait for ever.)
    """
    begin("asking")  # a handler that asks as well must not evaluate inside of this
    try:
        view_layer.update()
    except RuntimeError:
        return False
    finally:
        end("asking")
    return True


def is_asking() -> bool:
    """Whether `evaluate_pending` is under way on this thread: what asks then is called by an evaluation."""
    return is_main_thread() and "asking" in _under_way


# Evaluation log ------------------------------------------------------------------------------------------------------
# The evaluations of Blender, and since when they are known: so a sync can skip unchanged meshes and objects.
#
# The depsgraph names evaluated data-blocks only while its handlers run, and once for each depsgraph (a viewport's, a
# render's, one a view layer). The log keeps them. If anything may have happened unseen (an undo, a file, handlers
# that were missing), it drops all earlier entries, and says so.
#
# It misses edits that Blender itself does not notice: Blender 4.2 lets `foreach_set` write into a mesh
# without evaluating anything, and a script may write into evaluated data. `SceneSync.update(verify=True)` finds those.


_MOST_GRAPHS = 16
_MOST_IDS = 100_000

_Object = bpy.types.Object  # looking it up is slow
# Data-blocks that change no more than other data-blocks, which are named themselves, or that are read every time.
_HARMLESS = (bpy.types.Action, bpy.types.Camera)


@dataclass(slots=True)
class _Times:
    """The times of last evaluations in one depsgraph: by session uid, or of anything else, or of all."""

    geometry: dict[int, int] = field(default_factory=dict)
    objects: dict[int, int] = field(default_factory=dict)  # their transforms or settings, and no geometry
    other: int = 0  # lists of objects, materials, the world: what may change any object


class EvaluationLog:
    """When each data-block was last evaluated, in one depsgraph and another."""

    def __init__(self) -> None:
        self._now = 0
        self._known_since = 0
        self._graphs: dict[int, _Times] = {}

    def add(self, depsgraph: Any) -> None:
        """Records a depsgraph's latest evaluation; only available while its handlers run."""
        times: _Times | None = None
        for update in depsgraph.updates:
            if times is None:
                self._now += 1
                times = self._times_of(depsgraph.as_pointer())
            block = update.id
            if update.is_updated_geometry:
                times.geometry[block.original.session_uid] = times.other = self._now
            elif isinstance(block, _Object):
                times.objects[block.original.session_uid] = self._now
            elif not isinstance(block, _HARMLESS):
                times.other = self._now
        if times is not None and len(times.geometry) + len(times.objects) > _MOST_IDS:
            self.forget()

    def forget(self) -> None:
        """Drops all entries: earlier events may have been missed."""
        self._now += 1
        self._known_since = self._now
        self._graphs.clear()

    @property
    def now(self) -> int:
        """The present, for the questions later."""
        return self._now

    def is_untouched(self, graph: int, uids: tuple[int, ...], since: int) -> bool:
        """Whether no data-block of these session uids had its geometry evaluated after `since`.

        graph: the depsgraph's address.
        """
        if since < self._known_since:
            return False
        times = self._graphs.get(graph)
        return times is None or all(times.geometry.get(uid, 0) <= since for uid in uids)

    def find_touched(self, graph: int, since: int) -> frozenset[int] | None:
        """Session uids of the objects of which transform or settings were evaluated after `since`.

        None if anything else was, too, or may have been: then any object may be another one.
        """
        if since < self._known_since:
            return None
        times = self._graphs.get(graph)
        if times is None:
            return frozenset()
        if times.other > since:
            return None
        return frozenset(uid for uid, time in times.objects.items() if time > since)

    def _times_of(self, graph: int) -> _Times:
        times = self._graphs.get(graph)
        if times is None:
            if len(self._graphs) >= _MOST_GRAPHS:  # renders make a new one for each frame
                self.forget()
            times = self._graphs[graph] = _Times()
        return times
