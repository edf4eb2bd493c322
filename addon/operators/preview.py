"""The Preview button: the view of a 3D viewport as an image in the Image Editor, whatever the render engine is.

In a window it works while Blender goes on: it refines the image in steps of a timer, shows each round, and stops at Esc
with what it has. Without one it does the same in one go, through the scene's camera.
"""

from __future__ import annotations

from typing import Any, ClassVar

import bpy
import numpy as np

from ..preferences import native_error
from ..properties import read_settings
from ..refinement import Image, Pace, Refinement
from ..screen_image import picture_of
from ..viewport import REFINING_SECONDS, find_view, refine_view, remember_view

IMAGE_NAME = "Perfect BVH Preview"
TIMER_SECONDS = 0.01


class PERFECT_BVH_OT_preview(bpy.types.Operator):
    """Refines the view in steps of a timer."""

    bl_idname = "perfect_bvh.preview"
    bl_label = "Preview"
    bl_description = "Render the current view with these settings into an image that the Image Editor shows"
    bl_options: ClassVar = {"REGISTER"}

    _timer: bpy.types.Timer | None = None
    _sync: Any  # a SceneSync: Blender evaluates these annotations, and its module needs the native engine
    _refinement: Refinement

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        error = native_error()
        if error is not None:
            cls.poll_message_set(error)
            return False
        if find_view(context) is None and context.scene.camera is None:
            cls.poll_message_set("There is neither a 3D viewport nor a camera")
            return False
        return True

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self._begin(context):
            return {"CANCELLED"}
        self._refinement.step(REFINING_SECONDS)
        image = _store(self._refinement.image, context.scene)
        show_in_editor(context, image)
        manager = context.window_manager
        self._timer = manager.event_timer_add(TIMER_SECONDS, window=context.window)
        manager.progress_begin(0, 100)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC":
            self._end(context)
            self.report({"INFO"}, f"Stopped after {self._refinement.sample_count} samples")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self._refinement.step(REFINING_SECONDS):
            _store(self._refinement.image, context.scene)
            context.window_manager.progress_update(100 * self._refinement.progress)
        if not self._refinement.is_finished:
            return {"RUNNING_MODAL"}
        self._end(context)
        return {"FINISHED"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self._begin(context):
            return {"CANCELLED"}
        while not self._refinement.is_finished:
            self._refinement.step(REFINING_SECONDS)
        _store(self._refinement.image, context.scene)
        remember_view("Preview", self._sync, self._refinement, context.scene)
        return {"FINISHED"}

    def _begin(self, context: bpy.types.Context) -> bool:
        import perfect_bvh

        try:
            self._sync, self._refinement = refine_view(context, read_settings(context.scene), Pace())
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            self.report({"ERROR"}, str(problem) or type(problem).__name__)
            return False
        return True

    def _end(self, context: bpy.types.Context) -> None:
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()


def _store(pixels: Image | None, scene: bpy.types.Scene) -> bpy.types.Image:
    """Put an image into the data-block of previews, which is made when it is missing or has been given away."""
    assert pixels is not None
    pixels = picture_of(pixels, scene.perfect_bvh.mode.lower())
    height, width = pixels.shape[:2]
    image = bpy.data.images.get(IMAGE_NAME)
    if image is not None and (image.source != "GENERATED" or not image.is_float or image.library is not None):
        image = None
    if image is None:
        image = bpy.data.images.new(IMAGE_NAME, width, height, alpha=True, float_buffer=True)
        image.alpha_mode = "PREMUL"
    elif tuple(image.size) != (width, height):
        image.scale(width, height)
    image.pixels.foreach_set(np.ascontiguousarray(pixels[::-1], np.float32).ravel())
    image.update()
    return image


def show_in_editor(context: bpy.types.Context, image: bpy.types.Image) -> None:
    """In an Image Editor that is open, or where the user wants renders to appear."""
    if not _set_in_editors(context, image):
        bpy.ops.render.view_show("INVOKE_DEFAULT")
        _set_in_editors(context, image)


def _set_in_editors(context: bpy.types.Context, image: bpy.types.Image) -> bool:
    """Show it in the first Image Editor of any window; whether there is one."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR" and area.ui_type == "IMAGE_EDITOR":
                area.spaces.active.image = image
                _show_whole(window, area)
                return True
    return False


def _show_whole(window: bpy.types.Window, area: bpy.types.Area) -> None:
    """As large as it is, or smaller, so that all of it can be seen."""
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.image.view_all()
    area.tag_redraw()


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_OT_preview)


def unregister() -> None:
    bpy.utils.unregister_class(PERFECT_BVH_OT_preview)
