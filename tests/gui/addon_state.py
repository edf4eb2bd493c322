"""The state of the add-on and Blender, for steps to check: images of viewports, the overlay, reports."""

from __future__ import annotations

import gc
import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy
from driver import Step, check, redrawn, wait_until
from places import area_of, context_of

MODULE = "bl_ext.user_default.perfect_bvh"

events: list[str] = []
measured: dict[str, float] = {}


def _note(name: str) -> Any:
    def handler(*_: object) -> None:
        events.append(name)

    return bpy.app.handlers.persistent(handler)


for _name in ("render_complete", "render_cancel", "frame_change_post"):
    getattr(bpy.app.handlers, _name).append(_note(_name))


def module(name: str) -> Any:
    """Return a module of the add-on; some are imported only when they are needed."""
    return importlib.import_module(f"{MODULE}.{name}")


def settings() -> Any:
    return bpy.context.scene.perfect_bvh


def viewports() -> list[Any]:
    """The renderers of the regions that are shown in Rendered shading."""
    return [found for found in gc.get_objects() if type(found).__name__ == "Viewport" and found._refinement is not None]


def all_finished() -> bool:
    found = viewports()
    return bool(found) and all(v.state.startswith("Done") and not v.is_working for v in found)


def finished(what: str) -> Step:
    yield from redrawn()
    yield from wait_until(all_finished, f"{what}: the viewport is not finished")


def image() -> Any:
    """(H, W, 4) float32 of the only viewport."""
    (viewport,) = viewports()
    return viewport._refinement.image.copy()


def space() -> bpy.types.SpaceView3D:
    return area_of("VIEW_3D").spaces.active


def overlay_settings() -> Any:
    """Which boxes the first viewport shows."""
    return space().shading.perfect_bvh.overlay


def overlay() -> Any:
    """The drawn boxes of the trees, None if there are none."""
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        return module("view3d.tree_overlay.overlay").overlay_of(bpy.context)


def is_playing() -> bool:
    return bpy.context.window_manager.windows[0].screen.is_animation_playing


def is_working() -> bool:
    """Whether one of the add-on's operators goes on in steps of a timer."""
    windows = bpy.context.window_manager.windows
    return any("perfect_bvh" in operator.bl_idname.lower() for window in windows for operator in window.modal_operators)


def close_image_windows() -> Step:
    """Renders open a new window, or replace an area."""
    for window in list(bpy.context.window_manager.windows)[1:]:
        with bpy.context.temp_override(window=window):
            bpy.ops.wm.window_close()
    yield from redrawn()
    for area in bpy.context.window_manager.windows[0].screen.areas:
        if area.type == "IMAGE_EDITOR":
            area.type = "VIEW_3D"
    yield from redrawn()


@contextmanager
def _all_reports_selected() -> Iterator[None]:
    """Select all reports in an Info editor that replaces the smallest area."""
    area = min(bpy.context.window_manager.windows[0].screen.areas, key=lambda area: area.width * area.height)
    before, area.ui_type = area.ui_type, "INFO"
    try:
        with bpy.context.temp_override(**context_of(area)):
            bpy.ops.info.select_all(action="SELECT")
            yield
    finally:
        area.ui_type = before


def forget_reports() -> None:
    """Ignore earlier reports from now on."""
    with _all_reports_selected():
        bpy.ops.info.report_delete()


def reported(text: str) -> bool:
    """Whether Blender has reported something with this text in it, as the Info editor lists it."""
    bpy.context.window_manager.clipboard = ""
    with _all_reports_selected():
        bpy.ops.info.report_copy()
    return text in bpy.context.window_manager.clipboard


def wait_for_report(text: str) -> Step:
    yield from wait_until(lambda: reported(text), f"no report of {text!r}", every=0.2)


def check_shows_something(pixels: Any, what: str) -> None:
    check(pixels[..., 3].max() > 0.0, f"{what}: the image is empty")
    check(pixels[..., :3].std() > 0.01, f"{what}: the image is of one color")
