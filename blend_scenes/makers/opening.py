"""How a file looks when it is opened: the scene through its camera in Rendered shading, next to the render settings."""

from __future__ import annotations

import atexit
from typing import Any

import bpy

ENGINE = "PERFECT_BVH"
WORKSPACE = "Layout"
CAMERA_ZOOM = 20.0  # the camera's picture takes most of the view, between its toolbars


def use_engine(scene: Any) -> None:
    """Select the add-on's engine; the add-on must be installed, because Blender drops unknown engines."""
    import perfect_bvh_addon

    if not hasattr(bpy.types.Scene, "perfect_bvh"):
        perfect_bvh_addon.register()
        atexit.register(perfect_bvh_addon.unregister)  # Blender's module does not end well without
    scene.render.engine = ENGINE


def open_rendered() -> Any:
    """The screen that a file opens with, so that its 3D view is Rendered and looks through the camera."""
    screen: Any = bpy.data.workspaces[WORKSPACE].screens[0]
    bpy.context.window_manager.windows[0].workspace = bpy.data.workspaces[WORKSPACE]
    screen.perfect_bvh_open_rendered = True
    for area in screen.areas:
        if area.type == "VIEW_3D":
            look_through_camera(area.spaces.active)
        elif area.type == "PROPERTIES":
            area.spaces.active.context = "RENDER"
    return screen


def look_through_camera(space: Any) -> None:
    """Blender always opens it in Solid shading; the add-on then applies the screen's setting."""
    space.show_region_ui = False
    space.region_3d.view_perspective = "CAMERA"
    space.region_3d.view_camera_zoom = CAMERA_ZOOM
    space.region_3d.view_camera_offset = (0.0, 0.0)
