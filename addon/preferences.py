"""The add-on's preferences, and whether its native engine could be loaded.

Blender must survive a native module that cannot be loaded (a wrong platform, a damaged download): the add-on
then still registers, and says the reason here, in the render panel, and in the error of a render.
"""

from __future__ import annotations

import functools

import bpy


@functools.cache
def native_error() -> str | None:
    """Why the native engine cannot be used, in one sentence; None if it can."""
    try:
        import perfect_bvh  # noqa: F401
    except ImportError as error:
        return f"The native engine could not be loaded: {error}"
    return None


def native_summary() -> str:
    """The engine's version and how many threads it uses, in one line."""
    import perfect_bvh

    return f"Engine {perfect_bvh.__version__}, {perfect_bvh.thread_count()} threads"


class PERFECT_BVH_AP_preferences(bpy.types.AddonPreferences):
    """Shows the engine's state; everything that can be set belongs to a scene."""

    bl_idname = __package__

    def draw(self, context: bpy.types.Context) -> None:
        error = native_error()
        if error is None:
            self.layout.label(text=native_summary(), icon="CHECKMARK")
        else:
            self.layout.label(text=error, icon="ERROR")


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_AP_preferences)


def unregister() -> None:
    bpy.utils.unregister_class(PERFECT_BVH_AP_preferences)
    native_error.cache_clear()
