"""The screen of a file when it is opened: the scene through its camera, and next to it the instructions."""

from __future__ import annotations

from typing import Any

import bpy

from ..opening import WORKSPACE, open_rendered

VIEW_SHARE = 0.6  # of the width that the view and the text have together
PICTURE_SHARE = 0.45  # of the height that the view and the picture have together
PICTURE_ZOOM = 224.0
CAMERA_ZOOM = 14.0  # as large as the picture


def show_lesson(text: Any, picture: Any = None) -> None:
    """One workspace: a 3D view through the camera, a picture below it, the text at its top, render settings."""
    screen = open_rendered()
    bpy.data.batch_remove([space for space in bpy.data.workspaces if space.name != WORKSPACE])
    view = next(area for area in screen.areas if area.type == "VIEW_3D")
    text_area = _split(screen, view, "VERTICAL", VIEW_SHARE)
    text_area.type = "TEXT_EDITOR"
    if picture is not None:
        picture_area = _split(screen, view, "HORIZONTAL", PICTURE_SHARE)
        picture_area.type = "IMAGE_EDITOR"
        _show_picture(picture_area.spaces.active, picture)
        view.spaces.active.region_3d.view_camera_zoom = CAMERA_ZOOM
    view.spaces.active.overlay.show_overlays = False
    _open_text(text_area.spaces.active, text)


def _split(screen: Any, area: Any, direction: str, share: float) -> Any:
    """The new area, to the right of the rest of the old one, or below."""
    before = {other.as_pointer() for other in screen.areas}
    region = next(region for region in area.regions if region.type == "WINDOW")
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window, screen=screen, area=area, region=region):
        bpy.ops.screen.area_split(direction=direction, factor=share)
    return next(other for other in screen.areas if other.as_pointer() not in before)


def _open_text(space: Any, text: Any) -> None:
    """Scrolled to its top, with the cursor there: Blender scrolls to where the cursor is."""
    text.cursor_set(0)
    space.text = text
    space.top = 0
    space.show_word_wrap = True
    space.show_line_numbers = False
    space.show_syntax_highlight = text.name.endswith(".py")


def _show_picture(space: Any, picture: Any) -> None:
    space.image = picture
    space.use_image_pin = True  # renders are shown elsewhere
    space.zoom_percentage = PICTURE_ZOOM
    space.show_region_ui = space.show_region_toolbar = False
