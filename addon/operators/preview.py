"""The button Render View to Image: a 3D viewport's view in the Image Editor, for any render engine.

In a window it works while Blender continues: trees are built and the image is traced in the background, a timer shows
how far it is, and Esc cancels it and keeps the image so far. Without one it does the same in one go, through the
scene's camera.
"""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Iterator
from typing import ClassVar

import bpy
import numpy as np

from ..image.progressive import SHOW_SECONDS, Pace
from ..image.refinement import Refinement, Tracer
from ..live.pending_commit import LOOKING_SECONDS
from ..settings.modes import find_mode
from ..settings.preferences import redraw_viewports
from ..statistics.last_result import note_image
from ..statistics.words import times
from ..view3d.rendered.redraws import AwaitedView, await_view, find_view
from ..view3d.rendered.screen import picture_of, remember_view
from .ticking import Ticking

IMAGE_NAME = "Perfect BVH View"
REFINING_SECONDS = 0.1  # of a step without a window


class PERFECT_BVH_OT_preview(Ticking, bpy.types.Operator):
    """Looks in steps of a timer at the view, which is traced in the background."""

    bl_idname = "perfect_bvh.preview"
    bl_label = "Render View to Image"
    bl_description = (
        "Render what the 3D viewport shows into an image, and show it in the Image Editor. A Rendered viewport has its "
        "own Mode and lighting, other viewports those of the Render properties"
    )
    bl_options: ClassVar = {"REGISTER"}

    _scene_uid: int
    _view: AwaitedView
    _refinement: Refinement | None = None
    _revision: int  # of the trees that the image shows
    _tracer: Tracer
    _started: float  # the tracing
    _shows_at = float("-inf")  # when a better image may be shown
    _image_uid: int | None = None  # None before there is any
    _size = (0, 0)  # of the image
    _window: int | None = None  # the one that was opened for the image

    @classmethod
    def _find_complaint(cls, context: bpy.types.Context) -> str | None:
        is_lost = find_view(context) is None and context.scene.camera is None
        return "There is neither a 3D viewport nor a camera" if is_lost else None

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self._begin(context) or not self._attempt(self._begin_image):
            return {"CANCELLED"}
        refinement = self._refinement
        assert refinement is not None
        while not refinement.is_finished:
            refinement.step(REFINING_SECONDS)
        _store(refinement)
        self._remember(refinement)
        return {"FINISHED"}

    # The parts -------------------------------------------------------------------------------------------------------

    def _begin(self, context: bpy.types.Context) -> bool:
        return self._attempt(lambda: self._read(context))

    def _tick(self, context: bpy.types.Context) -> set[str] | None:
        if not self._attempt(lambda: self._build(context) if self._refinement is None else self._refine(context)):
            self._end(context)
            return {"CANCELLED"}
        if self._shows_at < float("inf"):  # the finished image is not shown yet
            return None
        self._end(context)
        self._remember(self._refinement)
        self._tell_where(context, "is")
        return {"FINISHED"}

    def _stop(self, context: bpy.types.Context) -> set[str]:
        if self._refinement is not None and self._image_uid is not None:
            _store(self._refinement)
        return Ticking._stop(self, context)

    def _stopped(self) -> str:
        count = None if self._refinement is None else self._refinement.sample_count
        return "Canceled before the first sample" if not count else f"Canceled after {count} samples"

    def _attempt(self, work: Callable[[], None]) -> bool:
        """Whether it has succeeded; the reason is reported if not."""
        import perfect_bvh

        try:
            work()
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            self._complain(problem)
            return False
        return True

    def _read(self, context: bpy.types.Context) -> None:
        """Read the current scene, and begin to build its trees."""
        self._forget_complaints()
        self._scene_uid = context.scene.session_uid
        self._view = await_view(context)

    def _begin_image(self) -> None:
        self._refinement = self._view.refine(Pace())
        self._revision = self._view.sync.revision
        self._tracer, self._started = Tracer(), time.monotonic()

    def _remember(self, refinement: Refinement) -> None:
        """Remember the result, unless the scene or its trees have changed: costs would belong to no known mesh."""
        view = self._view
        scene = next((scene for scene in bpy.data.scenes if scene.session_uid == self._scene_uid), None)
        if scene is not None and view.sync.revision == self._revision and view.sync.scene.is_current:
            own = view.has_own_mode
            remember_view("View to Image", view.sync, refinement, scene, view.edits, has_own_mode=own)

    def _build(self, context: bpy.types.Context) -> None:
        """Look whether the trees are there; if they are, begin to trace."""
        import perfect_bvh

        self._show_state(context)
        if not self._view.building.wait(LOOKING_SECONDS):
            return
        try:
            self._begin_image()
        except perfect_bvh.Cancelled:
            # A viewport, which shares the trees, has found the scene changed and has others built: wait for those.
            if context.scene.session_uid != self._scene_uid:
                raise ValueError("the scene is no longer shown in a window") from None
            self._read(context)
            return
        assert self._refinement is not None
        redraw_viewports(context)  # their overlays have waited for the trees, too
        weakref.finalize(self, self._tracer.stop).atexit = False  # Blender may forget its operator
        self._tracer.trace(self._refinement)

    def _tell_where(self, context: bpy.types.Context, what: str) -> None:
        """Which image to look at, where the user has Blender open no editor for renders and none is open."""
        image = next((image for image in bpy.data.images if image.session_uid == self._image_uid), None)
        if image is not None and not any(area.spaces.active.image == image for _, area in _image_editors(context)):
            self.report({"INFO"}, f'The view {what} in the image "{image.name}": open an Image Editor to see it')

    def _refine(self, context: bpy.types.Context) -> None:
        """Show the image as it is now, if it is time; the finished one at once."""
        refinement, problem = self._refinement, self._tracer.problem
        assert refinement is not None
        if problem is not None:
            raise problem
        is_finished = refinement.is_finished
        if not is_finished and time.monotonic() < self._shows_at:
            return
        self._show_state(context)
        context.window_manager.progress_update(100 * refinement.progress)
        if refinement.image is not None:
            self._show_image(context, refinement)
            self._shows_at = float("inf") if is_finished else time.monotonic() + SHOW_SECONDS

    def _show_image(self, context: bpy.types.Context, refinement: Refinement) -> None:
        image, before = _store(refinement), _windows(context)
        is_new, is_finer = self._image_uid is None, self._size != tuple(image.size)
        self._image_uid, self._size = image.session_uid, tuple(image.size)
        if is_new:
            show_in_editor(context, image)
            self._tell_where(context, "is being rendered")
            self._window = next(iter(_windows(context) - before), None)
        elif is_finer:  # an editor that showed all of the coarse image would show a part of this one
            _fit_editors(context, image)

    def _is_closed(self, context: bpy.types.Context) -> bool:
        """Whether the image's window is gone: Esc over it goes to that, not to this operator."""
        return self._window is not None and self._window not in _windows(context)

    def _show_state(self, context: bpy.types.Context) -> None:
        if self._refinement is None:
            state = f"Building BVHs {self._view.building.share:.0%}"
        else:
            done, samples = self._refinement.progress, self._refinement.view.plan.samples
            state = f"Sample {round(done * samples)}/{samples} | {times(time.monotonic() - self._started, done)}"
        self._tell(context, f"{state} | Esc: Cancel")

    def _end(self, context: bpy.types.Context) -> None:
        if self._refinement is None:
            self._view.building.stop()
        else:
            self._tracer.end()
        self._end_ticking(context)


def _store(refinement: Refinement) -> bpy.types.Image:
    """Put an image into the data-block of such images, which is made when it is missing or has been given away."""
    assert refinement.image is not None
    mode = refinement.view.plan.settings.mode
    pixels = picture_of(refinement.image, mode)
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
    image.use_view_as_render = find_mode(mode).view is None  # tones as in the viewport
    note_image(image, mode)
    return image


def show_in_editor(context: bpy.types.Context, image: bpy.types.Image) -> bool:
    """Shows an image in an open Image Editor, or where the user's preferences say that renders appear.

    Returns False if that is nowhere.
    """
    if set_in_editors(context, image):
        return True
    bpy.ops.render.view_show("INVOKE_DEFAULT")
    return set_in_editors(context, image)


def _windows(context: bpy.types.Context) -> set[int]:
    return {window.as_pointer() for window in context.window_manager.windows}


def set_in_editors(context: bpy.types.Context, image: bpy.types.Image) -> bool:
    """Show it in the first Image Editor of any window whose image is not pinned; whether there is one."""
    for window, area in _image_editors(context):
        space = area.spaces.active
        if area.ui_type == "IMAGE_EDITOR" and not space.use_image_pin:
            space.image = image
            _show_whole(window, area)
            return True
    return False


def _fit_editors(context: bpy.types.Context, image: bpy.types.Image) -> None:
    """Show the whole of it where it is shown."""
    for window, area in _image_editors(context):
        if area.spaces.active.image == image:
            _show_whole(window, area)


def _image_editors(context: bpy.types.Context) -> Iterator[tuple[bpy.types.Window, bpy.types.Area]]:
    """Yields all open ones, with their windows; the UV Editor is one, too."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                yield window, area


def _show_whole(window: bpy.types.Window, area: bpy.types.Area) -> None:
    """Show the image at its size, or smaller, so that all of it is visible."""
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.image.view_all()
    area.tag_redraw()


CLASSES = (PERFECT_BVH_OT_preview,)
