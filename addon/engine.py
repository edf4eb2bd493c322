"""The render engine: Blender asks for a frame, the cached sync is brought in step and traced, passes are filled.

The scene and its trees live on in the cache of syncs, because Blender makes a new engine for each render and often for
each frame. A begun result is always ended: without that Blender crashes when it writes the file.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import bpy
import numpy as np

from .image.data_previews import render_preview
from .image.plan import RenderPlan, enabled_passes, plan_layer, plan_render
from .image.progressive import Throttle
from .image.still import CameraReader, Frame, Images, Progress, render_frame, write_passes
from .settings.preferences import native_error
from .settings.scene_settings import ENGINE_NAME, preview_settings
from .statistics import messages
from .statistics.last_result import FrameStatistics, edits_of, remember
from .statistics.not_shown import line_in_viewports, tell
from .statistics.words import memory, reason_of, sentence, times
from .sync.not_shown import summarize
from .sync.records import CameraRecord
from .view3d.rendered.viewport import Viewport

if TYPE_CHECKING:
    from .live.scene_sync import SceneSync

T = TypeVar("T")

STATUS_SECONDS = 0.25

# Without a window rounds are not shown: the image is written when it is finished.
SHOWS_ROUNDS = not bpy.app.background


@dataclass(slots=True)
class RenderJob:
    """The extra inputs and outputs of a caller of `bpy.ops.render.render`, in addition to the Render Result.

    A headless Render Result cannot be read, and operators take no callbacks: scripts register a job with `attend` and
    find the last frame in it. progress: called with 0..1, returns False to cancel.
    """

    progress: Progress | None = None
    frame: Frame | None = None
    is_cancelled: bool = False


_job: RenderJob | None = None


@contextmanager
def attend(job: RenderJob) -> Iterator[RenderJob]:
    """While this is active, renders of this engine report to `job`."""
    global _job
    previous, _job = _job, job
    try:
        yield job
    finally:
        _job = previous


class RenderStatus:
    """Shows a render's progress in the render window, the status bar and the console, in Cycles' format."""

    def __init__(self, engine: bpy.types.RenderEngine, sync: SceneSync) -> None:
        self._engine, self._sync = engine, sync
        self._started = time.monotonic()
        self._text, self._stage = "", ""
        self._next = 0.0

    def tell(self, text: str) -> None:
        """The stage and how far it is, such as "Sample 3/16"."""
        self._text = text
        if text.split()[0] != self._stage:
            self._stage, self._next = text.split()[0], 0.0
            self.show(0.0)

    def show(self, done: float) -> None:
        """Updates at most every STATUS_SECONDS, but each new stage at once. done: of the frame, 0 to 1."""
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + STATUS_SECONDS
        self._send(f"{times(now - self._started, done)} | Mem: {memory(self._sync.byte_count)} | {self._text}")

    def _send(self, text: str) -> None:
        self._engine.update_stats("", text)


class PerfectBVHRenderEngine(bpy.types.RenderEngine):
    """Blender's face of the renderer."""

    bl_idname = ENGINE_NAME
    bl_label = "Perfect BVH"
    bl_use_preview = True
    bl_use_postprocess = True
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False

    _region_viewport: Viewport | None = None
    _status: RenderStatus  # of the frame that is being rendered
    _rendered: frozenset[tuple[int, float, str]] = frozenset()  # scene, frame and layer of the parts of one image

    def update_render_passes(self, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> None:
        """Tell the compositor which sockets the engine's layer has."""
        self.register_pass(scene, view_layer, "Combined", 4, "RGBA", "COLOR")
        for spec in enabled_passes(view_layer, scene):
            self.register_pass(scene, view_layer, spec.name, len(spec.channels), spec.channels, spec.kind)

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Render one view layer of one frame, with each eye if there are several; or a preview, or a reading."""
        if self.is_preview:
            self._render_preview(depsgraph)  # no render of the scene: nothing is kept or reported of it
            return
        scene, layer_name = depsgraph.scene, depsgraph.view_layer.name
        if (error := native_error()) is not None:
            self._begin_part(scene, layer_name)
            self._fail(scene, error)
            return
        from .live.scene_view import serve_visit

        if serve_visit(self, depsgraph):
            return
        self._begin_part(scene, layer_name)
        edits = edits_of(scene)  # users continue to edit while it renders on another thread
        plan, views = plan_layer(depsgraph), _view_names(scene)
        try:
            plan.check_memory()  # before Blender allocates the image
            if not views:
                raise ValueError(f'No active view found in scene "{scene.name}": enable one under Output > Stereoscopy')
        except ValueError as problem:
            self._fail(scene, str(problem))
            return
        for spec in plan.specs:
            self.add_pass(spec.name, len(spec.channels), spec.channels, layer=layer_name)
        for view in views:
            if not self._render_view(depsgraph, plan, view, edits):
                return

    def _render_preview(self, depsgraph: bpy.types.Depsgraph) -> None:
        """A material, a light or a world on Blender's own stage."""
        error = native_error()
        if error is not None:
            self.error_set(error)
            return
        import perfect_bvh

        plan = plan_render(depsgraph.scene, preview_settings())
        result = self.begin_result(0, 0, *plan.size, layer=depsgraph.view_layer.name)
        try:
            image = render_preview(depsgraph, plan, self.test_break)
            if image is not None:
                write_passes(result.layers[0], (), {"combined": image}, plan.window)
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            self.error_set(sentence(reason_of(problem)))
        finally:
            self.end_result(result)

    # The viewport ----------------------------------------------------------------------------------------------------

    def view_update(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Something that a viewport shows has changed."""
        if self._can_view():
            self._attempt(depsgraph.scene, lambda: self._viewport().update(context, depsgraph))

    def view_draw(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Draw a viewport. It asks to be drawn again by itself, when there is more of its image."""
        if not self._can_view():
            return
        viewport, scene = self._viewport(), depsgraph.scene
        if self._attempt(scene, lambda: viewport.draw(self, context, depsgraph)) is not None:
            self.update_stats(viewport.complaint or line_in_viewports(scene), sentence(viewport.state))
            failure = viewport.failure
            messages.tell_of_view(scene, viewport, failure or viewport.complaint, is_error=failure is not None)

    def _can_view(self) -> bool:
        error = native_error()
        if error is not None:
            self.update_stats("", error)
        return error is None

    def _viewport(self) -> Viewport:
        """This region's renderer. Made when it is needed: Blender's versions disagree on an engine's `__init__`."""
        if self._region_viewport is None:
            self._region_viewport = Viewport()
        return self._region_viewport

    def _attempt(self, scene: bpy.types.Scene, work: Callable[[], T]) -> T | None:
        """The result of `work`; None if it failed, with the reason shown in the viewport."""
        import perfect_bvh

        try:
            return work()
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            text = sentence(reason_of(problem))
            self.update_stats("", text)
            messages.tell_of_view(scene, self._viewport(), text, is_error=True)
            return None

    # The parts of a render -------------------------------------------------------------------------------------------

    def _begin_part(self, scene: bpy.types.Scene, layer_name: str) -> None:
        """Drops earlier results, except other layers of the same image."""
        part = (scene.original.session_uid, scene.frame_current_final, layer_name)
        goes_on = part not in self._rendered and any(part[:2] == other[:2] for other in self._rendered)
        self._rendered = (self._rendered if goes_on else frozenset()) | {part}
        if not goes_on:
            messages.begin_render(scene)

    def _render_view(self, depsgraph: bpy.types.Depsgraph, plan: RenderPlan, view: str, edits: int) -> bool:
        """Whether there was an image. view: the name of one of several, "" if there is only one."""
        if view:
            self.active_view_set(view)
        left, right, bottom, top = plan.window
        result = self.begin_result(0, 0, right - left, top - bottom, layer=depsgraph.view_layer.name, view=view)

        def show(images: Images) -> None:
            write_passes(result.layers[0], plan.specs, images, plan.window)
            self.update_result(result)

        try:
            camera = partial(self._read_camera, plan) if view else None
            frame = self._render_frame(depsgraph, plan, Throttle(show) if SHOWS_ROUNDS else None, camera, edits)
            if frame is not None:
                write_passes(result.layers[0], plan.specs, frame.images, plan.window)
        finally:
            self.end_result(result)
        return frame is not None

    def _read_camera(self, plan: RenderPlan, depsgraph: bpy.types.Depsgraph) -> CameraRecord | None:
        """Returns the camera of the active view, from Blender; None if it is no camera that can be rendered."""
        from .extract.camera import Eye, read_camera

        camera = self.camera_override
        if camera is None:
            return None
        eye = Eye(np.array(self.camera_model_matrix(camera), np.float64), self.camera_shift_x(camera))
        return read_camera(camera.evaluated_get(depsgraph), plan.frame, eye)[0]

    def _render_frame(
        self,
        depsgraph: bpy.types.Depsgraph,
        plan: RenderPlan,
        show: Callable[[Images], None] | None,
        camera: CameraReader | None,
        edits: int,
    ) -> Frame | None:
        """The frame; None if the render was cancelled or failed, with an error reported."""
        import perfect_bvh

        from .live.sync_cache import sync_of

        job, scene = _job or RenderJob(), depsgraph.scene
        job.frame = None
        try:
            sync = sync_of(depsgraph)
            self._status = status = RenderStatus(self, sync)
            job.frame = render_frame(
                sync,
                depsgraph,
                plan,
                progress=lambda done: self._advance(job, done),
                tell=status.tell,
                show=show,
                camera=camera,
                frame_set=self.frame_set,
            )
        except perfect_bvh.Cancelled:
            job.is_cancelled = True
        except KeyboardInterrupt:
            job.is_cancelled = True
            self._fail(scene, "The render was interrupted")
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            self._fail(scene, reason_of(problem))
        else:
            remember(scene, job.frame.statistics, edits)
            megabytes = job.frame.statistics.report.byte_count / 2**20
            self.update_memory_stats(memory_used=megabytes, memory_peak=megabytes)
            self._complain(scene, job.frame.statistics)
        return job.frame

    def _complain(self, scene: bpy.types.Scene, statistics: FrameStatistics) -> None:
        """Reports problems of a finished image: for a few seconds, and in the panels until the next one."""
        not_shown = statistics.report.not_shown
        tell(scene, not_shown, goes_on=len(self._rendered) > 1)
        listed = {str(row) for row in not_shown}
        for warning in (*statistics.report.warnings, *statistics.complaints):
            self.report({"WARNING"}, warning)
            if warning not in listed:
                messages.add(scene, messages.RENDER, warning)
        if line := summarize(not_shown):
            self.report({"WARNING"}, f"{line}: see Not Shown in the Render properties")

    def _advance(self, job: RenderJob, done: float) -> bool:
        self._status.show(done)
        self.update_progress(done)
        wants_more = job.progress is None or job.progress(done)
        return wants_more and not self.test_break()

    def _fail(self, scene: bpy.types.Scene, reason: str) -> None:
        """A script gets a RuntimeError from the operator, a user the message in the Image Editor's header."""
        message = sentence(reason)
        messages.tell(scene, messages.RENDER, message, is_error=True)
        self.error_set(message)
        self.report({"ERROR"}, message)


def _view_names(scene: bpy.types.Scene) -> tuple[str, ...]:
    """Returns the names of a multiview render's views, in order; "" if the render has only one view."""
    render = scene.render
    if not render.use_multiview:
        return ("",)
    if render.views_format == "STEREO_3D":
        return tuple([view.name for view in render.views if view.name in {"left", "right"} and view.use])
    return tuple([view.name for view in render.views if view.use])


def register() -> None:
    """Make the engine known to Blender."""
    bpy.utils.register_class(PerfectBVHRenderEngine)


def unregister() -> None:
    """Take the engine away."""
    bpy.utils.unregister_class(PerfectBVHRenderEngine)
