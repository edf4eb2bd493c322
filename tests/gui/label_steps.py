"""The Label Images button: run it to its end, and check the Image Editor."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import bpy
from addon_state import forget_reports, module, settings, wait_for_report
from driver import Step, check, redrawn, screenshot, wait_until
from places import area_of, context_of


def label_images() -> Step:
    names = module("operators.label_button")
    folder = Path(tempfile.mkdtemp())
    settings().label_images.frame_end = 3
    bpy.ops.ed.undo_push(message="Unsaved")
    check(bpy.data.is_dirty, "several frames of a file that is not saved are the harder case")
    editor = min(bpy.context.window_manager.windows[0].screen.areas, key=lambda area: area.width * area.height)
    kind = editor.ui_type
    for ui_type, frames, told in (
        (kind, "CURRENT", "open an Image Editor to see it"),
        ("IMAGE_EDITOR", "RANGE", "Labelled 3 frames into"),
    ):
        editor.ui_type, settings().label_images.frames = ui_type, frames
        settings().label_images.folder = str(folder / frames)
        yield from redrawn()
        forget_reports()
        with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
            bpy.ops.perfect_bvh.label_images("INVOKE_DEFAULT")
        yield from wait_for_report(told)
        check(len(bpy.context.window_manager.windows) == 1, "a window opens")

    def shows_labels() -> bool:
        areas = [area for window in bpy.context.window_manager.windows for area in window.screen.areas]
        shown = [area.spaces.active.image for area in areas if area.type == "IMAGE_EDITOR"]
        return bpy.data.images[names.OBJECTS] in shown

    yield from wait_until(shows_labels, "no Image Editor shows the labels")
    yield from redrawn()
    screenshot("label_images")
    files = [path.name for path in folder.rglob("*_things.png")]
    check(sorted(files) == [f"labels_000{frame}_things.png" for frame in (1, 1, 2, 3)], f"files: {files}")
    settings().label_images.folder, settings().label_images.frames = "", "CURRENT"
    shutil.rmtree(folder)
    editor.ui_type = kind
    yield from redrawn()
