"""What a file shows when it is opened: the scene through its camera, and beside it what to do."""

from __future__ import annotations

from typing import Any

import bpy

VIEW_SHARE = 0.6  # of the width that the view and the text have together
WORKSPACE = "Layout"


def show_lesson(text: Any) -> None:
    """One workspace: a 3D view through the camera, the text at its top, and the render settings."""
    screen = bpy.data.workspaces[WORKSPACE].screens[0]
    bpy.data.batch_remove([space for space in bpy.data.workspaces if space.name != WORKSPACE])
    view = next(area for area in screen.areas if area.type == "VIEW_3D")
    text_area = _split(screen, view)
    text_area.type = "TEXT_EDITOR"
    _look_through_camera(view.spaces.active)
    _open_text(text_area.spaces.active, text)
    for area in screen.areas:
        if area.type == "PROPERTIES":
            area.spaces.active.context = "RENDER"


def _split(screen: Any, area: Any) -> Any:
    """The new area, to the right of what is left of the old one."""
    before = {other.as_pointer() for other in screen.areas}
    region = next(region for region in area.regions if region.type == "WINDOW")
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window, screen=screen, area=area, region=region):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=VIEW_SHARE)
    return next(other for other in screen.areas if other.as_pointer() not in before)


def _look_through_camera(space: Any) -> None:
    """Not in Rendered shading: whatever a file says, Blender opens it in Solid. The text says how to get there."""
    space.overlay.show_overlays = False
    space.show_region_ui = False
    space.region_3d.view_perspective = "CAMERA"
    space.region_3d.view_camera_zoom = 0.0
    space.region_3d.view_camera_offset = (0.0, 0.0)


def _open_text(space: Any, text: Any) -> None:
    """Scrolled to its top, with the cursor there: Blender scrolls to where the cursor is."""
    text.cursor_set(0)
    space.text = text
    space.top = 0
    space.show_word_wrap = True
    space.show_line_numbers = False
    space.show_syntax_highlight = text.name.endswith(".py")
