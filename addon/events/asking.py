"""Lets Blender evaluate what is pending, where it may be asked to.

It may be asked on its main thread, outside of evaluations and of renders, and while Python may use its context. Inside
a handler or a driver the evaluation that calls it would be entered a second time; a render reads the same data on
another thread. `changes.py` tells when evaluations and renders begin and end.
"""

from __future__ import annotations

import threading
from typing import Any

import bpy

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
    """For when an end may have been missed."""
    _under_way.clear()


def is_main_thread() -> bool:
    return threading.get_ident() == threading.main_thread().ident


def may_ask() -> bool:
    """Whether Blender may be asked here and now; a render in a window runs on a thread of its own, as a job."""
    return (
        is_main_thread()
        and not _under_way
        and isinstance(bpy.context, _Context)  # restricted while add-ons register
        and not is_render_job_running()
    )


def is_render_job_running() -> bool:
    """Whether a window's render is under way, on whichever thread this is asked."""
    return bool(bpy.app.is_job_running("RENDER"))


def evaluate_pending(view_layer: Any) -> bool:
    """Evaluates what is pending for a `bpy.types.ViewLayer`; where nothing is, it costs a microsecond.

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
