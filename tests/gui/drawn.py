"""Keeps track of the add-on's buttons that steps have pressed: at the end none must be left."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy
from addon_state import module
from places import area_of, context_of, front_window

# Before the names of the add-on's preferences, which scenes have settings of the same names for.
OF_PREFERENCES = "preferences."

drawn: set[str] = set()
pressed: set[str] = set()


class RecordingLayout:
    """Accepts any call of `UILayout`, and records the names of properties and operators."""

    def __init__(self, prefix: str = "") -> None:
        self._prefix = prefix

    def prop(self, owner: Any, name: str, **_: Any) -> None:
        drawn.add(f"{self._prefix}{name}")

    def operator(self, name: str, **_: Any) -> SimpleNamespace:
        drawn.add(name)
        return SimpleNamespace()

    def operator_menu_enum(self, name: str, *_: Any, **__: Any) -> None:
        drawn.add(name)

    def label(self, **_: Any) -> None:
        """Nothing to press."""

    def __getattr__(self, name: str) -> Any:
        """Layouts in the layout, and separators."""
        if name.startswith("_"):
            raise AttributeError(name)
        return lambda *_, **__: self


def note_drawn() -> None:
    """The buttons of the preferences and of every panel of the add-on that is shown now, as if all were open."""
    preferences = SimpleNamespace(layout=RecordingLayout(OF_PREFERENCES))
    module("settings.preferences").PERFECT_BVH_AP_preferences.draw(preferences, bpy.context)
    if not any(area.type == "PROPERTIES" for area in front_window().screen.areas):
        return
    stand = SimpleNamespace(layout=RecordingLayout())
    with bpy.context.temp_override(**context_of(area_of("PROPERTIES"))):
        tab = area_of("PROPERTIES").spaces.active.context.lower()
        of_tab = [panel for panel in module("panels").CLASSES if getattr(panel, "bl_context", "") == tab]
        # Of the sidebar only panels for a single task; the others have separate steps.
        others = module("panels.output").PERFECT_BVH_PT_scan, module("panels.reports").PERFECT_BVH_PT_bench
        for panel in (*of_tab, *others):
            if not panel.poll(bpy.context):
                continue
            if hasattr(panel, "draw_header"):
                panel.draw_header(stand, bpy.context)
            panel.draw(stand, bpy.context)


def note_pressed(what: str) -> None:
    """what: of a `Button`: the end of a data path, or an operator's call."""
    call = what.removeprefix("bpy.ops.")
    if call != what:
        pressed.add(call.partition("(")[0])
    else:
        pressed.add(what if what.startswith(OF_PREFERENCES) else what.rpartition(".")[2])
