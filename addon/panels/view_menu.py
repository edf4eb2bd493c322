"""The View menu of 3D viewports, where Blender renders viewports to images as well."""

from __future__ import annotations

import bpy

from ..settings.preferences import native_error


def _draw(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    if native_error() is None:
        menu.layout.separator()
        menu.layout.operator("perfect_bvh.preview", icon="RENDER_STILL")


def register() -> None:
    bpy.types.VIEW3D_MT_view.append(_draw)


def unregister() -> None:
    bpy.types.VIEW3D_MT_view.remove(_draw)
