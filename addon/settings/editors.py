"""Blender's editors, drawn again: it does so by itself only where its own operators or properties change something."""

from __future__ import annotations

from collections.abc import Iterator

import bpy


def redraw_viewports(context: bpy.types.Context | None = None) -> None:
    """All 3D viewports with their panels, in all windows."""
    _redraw("VIEW_3D", context)


def redraw_properties() -> None:
    """All Properties editors, in all windows."""
    _redraw("PROPERTIES", None)


def redraw_sidebars() -> None:
    """The sidebars of all 3D viewports, and nothing else of them."""
    for area in _areas("VIEW_3D", None):
        for region in area.regions:
            if region.type == "UI":
                region.tag_redraw()


def redraw_for_setting(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """The `update` of a setting that viewports show: panels redraw their own editor alone, scripts nothing."""
    redraw_viewports(context)


def _redraw(kind: str, context: bpy.types.Context | None) -> None:
    for area in _areas(kind, context):
        area.tag_redraw()


def _areas(kind: str, context: bpy.types.Context | None) -> Iterator[bpy.types.Area]:
    for window in (context or bpy.context).window_manager.windows:
        for area in window.screen.areas:
            if area.type == kind:
                yield area
