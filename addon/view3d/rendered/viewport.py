"""The "Rendered" shading of one region of a 3D viewport: updates its scene, refines its view, draws its image.

The image is traced on a separate thread, whether Blender redraws or not. A redraw updates the scene and the view,
waits only for a coarse image of changes, and draws the current image.

The trees belong to the cached sync, so all viewports of a Blender scene share them. A view that shows other objects
than the rest (local view, filters by type) has separate trees.

Modules that need the native engine are imported where they are used: without it the add-on must still register.
"""

from __future__ import annotations

import math
import time
import traceback
import weakref
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import bpy

from ...image.plan import RenderPlan, plan_view, trace_visits
from ...image.progressive import Pace
from ...image.refinement import DEFAULT_INTERVAL, Refinement, Tracer, View
from ...live.pending_commit import PendingCommit
from ...settings.shading_settings import read_view_settings
from ...statistics import not_shown
from ...statistics.last_result import confirm_view, edits_of
from ...statistics.words import reason_of
from ...sync.records import AttributeRequest, CameraRecord
from . import redraws
from .redraws import begin_view, filter_of
from .screen import ScreenImage, camera_of, draw_patches, remember_view
from .view_lighting import ViewLighting, lighting_of

if TYPE_CHECKING:
    from ...live.scene_sync import SceneSync, UpdateCommit

# The first image after a change is drawn in the next redraw, if it takes no longer than this; while an animation plays,
# for any time. Its resolution is chosen so that it takes much less.
AWAITING_SECONDS = 0.1
# Changes that follow each other as fast as that are strokes, drags and orbits: the next one comes as soon.
BURST_SECONDS = 0.5


@dataclass(frozen=True, slots=True)
class ViewKey:
    """All inputs of a view's image: while it is equal, the image is refined.

    scene_id, revision: of the sync's engine scene, which is unique, and of its content.
    """

    scene_id: int
    revision: int
    camera: tuple[Any, ...]
    plan: RenderPlan
    lighting: ViewLighting


class Viewport:
    """One region's renderer; lives as long as Blender's engine for the region does."""

    def __init__(self) -> None:
        self._trees = PendingCommit()
        self._own_sync: SceneSync | None = None
        self._shown_filter: tuple[bool, ...] = ()
        self._read_for: AttributeRequest | None = None
        self._pace = Pace()
        self._key: ViewKey | None = None
        self._refinement: Refinement | None = None
        self._tracer = Tracer()
        self._screen = ScreenImage()
        self._shown: tuple[Refinement | None, int, bool] = (None, 0, False)  # whose news, their number, its end
        self._remembered = 0  # 1: the cost of the first full image, 2: that of the last one
        self._changed_at = self._goes_on_at = float("-inf")  # by the clock: the last new view, when it may be refined
        self._told: BaseException | None = None
        self.region_pointer = 0
        """The address of the region that was drawn last."""
        self.asked_at = float("-inf")
        """When a redraw was asked for that has not come yet."""
        self.complaint: str | None = None
        """Why the view is not as it should be, as a sentence for the user."""
        # Blender may forget its engine in the middle of something.
        weakref.finalize(self, self._tracer.stop).atexit = False

    # The scene -------------------------------------------------------------------------------------------------------

    def update(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Read an evaluated depsgraph and update the trees. Raises the engine's errors."""
        self.stop()
        redraws.watch(self)
        space = context.space_data
        sync = self._sync_for(space, depsgraph)
        filtering = space if sync is self._own_sync else None
        plan = _plan_of(context, depsgraph)
        self._read_for = plan.attributes
        report = self._trees.begin(
            sync,
            lambda: self._begin(sync, depsgraph, plan, filtering),
            # An animation's next frame would stop what this one has begun: it waits, so that each is shown.
            to_the_end=context.screen.is_animation_playing,
        )
        if report is not None and not report.has_changes:
            confirm_view(depsgraph.scene, sync.last_change)

    def _begin(
        self, sync: SceneSync, depsgraph: bpy.types.Depsgraph, plan: RenderPlan, filtering: bpy.types.SpaceView3D | None
    ) -> UpdateCommit:
        building = begin_view(sync, depsgraph, plan, filtering)
        not_shown.tell_of_view(depsgraph.scene, self, sync.record.not_shown, with_looks=plan.attributes.shading)
        return building

    def _sync_for(self, space: bpy.types.SpaceView3D, depsgraph: bpy.types.Depsgraph) -> SceneSync:
        from ...live.scene_sync import SceneSync
        from ...live.sync_cache import sync_of

        self._shown_filter = filter_of(space)
        if not any(self._shown_filter):
            if self._own_sync is not None:
                self._own_sync.ask_to_stop_building()  # no view needs it any more
            self._own_sync = None
            return sync_of(depsgraph)
        if self._own_sync is None:
            self._own_sync = SceneSync(watch=False)
        return self._own_sync

    # The image -------------------------------------------------------------------------------------------------------

    def draw(self, engine: bpy.types.RenderEngine, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> bool:
        """Draw the best available image, and have it refined; returns whether there is more to come.

        Raises the engine's errors.
        """
        self.region_pointer, self.asked_at = context.region.as_pointer(), float("-inf")
        redraws.watch(self)
        if self._trees.sync is None or self._needs_other_reading(context, depsgraph):
            self.update(context, depsgraph)
        if not self._trees.are_there(lambda: self.update(context, depsgraph)):
            self._draw_screen(engine, context, depsgraph)
            return True
        sync = self._trees.sync
        assert sync is not None
        view_is_new = self._follow_view(sync, context, depsgraph)
        refinement = self._refinement
        if refinement is None:
            return False
        self._trace(refinement, view_is_new, context.screen.is_animation_playing)
        self._show(refinement)
        self._draw_screen(engine, context, depsgraph)
        remembered = (refinement.costs is not None) + refinement.is_finished
        if remembered > self._remembered:
            self._remembered = remembered
            remember_view("Viewport", sync, refinement, depsgraph.scene, edits_of(depsgraph.scene))
        return self.is_working

    def _trace(self, refinement: Refinement, view_is_new: bool, is_playing: bool) -> None:
        """Start the refinement; waits for a first image after a change, so that the drawing is current."""
        refinement.interval = max(redraws.budget.pause, DEFAULT_INTERVAL)
        if refinement.is_finished:
            return
        self._tracer.trace(refinement)
        if view_is_new:
            now = time.perf_counter()
            pause, self._changed_at = now - self._changed_at, now
            self._tracer.wait_for_image(math.inf if is_playing else AWAITING_SECONDS)
            # More of a view that is soon replaced would hardly be seen, but slow down Blender, which makes the next.
            if (is_playing or pause < BURST_SECONDS) and refinement.canvas.has_image.is_set():
                self._goes_on_at = now + 1.5 * pause
                self._tracer.stop()

    def _show(self, refinement: Refinement) -> None:
        """Fetch new parts. The previous image stays while there are none."""
        self.complaint = self.complaint or refinement.complaint
        has_ended, number = self._has_ended(refinement), refinement.canvas.number
        if self._shown[:2] != (refinement, number) and refinement.canvas.has_image.is_set():
            self._screen.fetch(refinement.canvas, refinement.view.plan.settings.mode)
        self._shown = (refinement, number, has_ended)

    def _draw_screen(
        self, engine: bpy.types.RenderEngine, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph
    ) -> None:
        if self._screen.patches:
            draw_patches(engine, depsgraph.scene, self._screen, (context.region.width, context.region.height))

    def _has_ended(self, refinement: Refinement) -> bool:
        return refinement.is_finished or self._tracer.problem is not None

    def visits_at(self, place: tuple[int, int]) -> tuple[int, int] | None:
        """See `redraws.Traced`."""
        if self._refinement is None or self._trees.is_building:
            return None
        view = self._refinement.view
        return trace_visits(view.snapshot, view.camera, view.plan.size, view.appearance, place)

    # What redraws are asked for --------------------------------------------------------------------------------------

    def stop(self) -> None:
        """Trace no more until the next redraw; from any thread, waiting for nothing."""
        self._tracer.stop()

    @property
    def is_working(self) -> bool:
        """Whether there is anything that has not been shown yet, or will be."""
        if self._trees.sync is None or self._trees.is_building:
            return self._trees.sync is not None  # after a failure nothing is done until something changes
        refinement = self._refinement
        return refinement is not None and not (self._shown[0] is refinement and self._shown[2])

    @property
    def has_news(self) -> bool:
        """Whether a redraw would show more than the last one."""
        refinement = self._refinement
        if self._trees.is_building or refinement is None:
            return self._trees.is_building
        news = (refinement, refinement.canvas.number, self._has_ended(refinement))
        # One that was stopped goes on in a redraw.
        return news != self._shown or (not self._tracer.is_running and time.perf_counter() >= self._goes_on_at)

    @property
    def is_denoised(self) -> bool:
        """Whether a redraw shows an image without noise."""
        return self._refinement is not None and self._refinement.canvas.is_replaced

    @property
    def has_ended(self) -> bool:
        """Whether nothing is worked on that a redraw could hold up."""
        if self._trees.is_building:
            return self._trees.is_over
        return not self._tracer.is_running

    def _needs_other_reading(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> bool:
        """Whether settings have changed that are not in the depsgraph: the view's filter, the mode."""
        wanted = _plan_of(context, depsgraph).attributes
        return self._shown_filter != filter_of(context.space_data) or self._read_for != wanted

    @property
    def failure(self) -> str | None:
        """Why the view is traced no further."""
        problem = self._tracer.problem
        return None if problem is None else self._tell(problem)

    @property
    def state(self) -> str:
        """How far the view is, as words for the user."""
        if self._trees.state is not None or self._refinement is None:
            return self._trees.state or ""
        if (failure := self.failure) is not None:
            return failure
        done, wanted = self._refinement.sample_count, self._refinement.view.plan.samples
        if self._refinement.is_finished:
            return f"Done ({done} sample{'s' if done != 1 else ''})"
        return f"Sample {done}/{wanted}" if done else "Preview"

    def _tell(self, problem: BaseException) -> str:
        """Report an exception of the thread, which would otherwise be lost."""
        from perfect_bvh import EngineError

        if problem is not self._told and not isinstance(problem, (ValueError, EngineError, MemoryError)):
            traceback.print_exception(problem)
        self._told = problem
        return reason_of(problem)

    def _follow_view(self, sync: SceneSync, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> bool:
        """Start over if the view has changed; returns whether it was unchanged."""
        from ...sync.appearance import as_camera

        camera, self.complaint = camera_of(context.region_data, context.space_data, depsgraph)
        if camera is None:
            self.stop()
            self._key = self._refinement = None
            return True
        plan = _plan_of(context, depsgraph)
        lighting = lighting_of(context.space_data.shading, depsgraph.scene)
        key = ViewKey(sync.scene.scene_id, sync.revision, _camera_key(camera), plan, lighting)
        if key == self._key:
            return False
        self._key, self._remembered = key, 0
        view = View.of(sync, as_camera(camera), plan)
        lit = lighting.light(view.appearance, sync.record.lights.of_world)
        self._refinement = Refinement(replace(view, appearance=lit), self._pace)
        return True


def _camera_key(camera: CameraRecord) -> tuple[Any, ...]:
    return (
        camera.matrix.tobytes(),
        camera.window,
        camera.projection,
        camera.clip_start,
        camera.clip_end,
        camera.border,
        camera.lens,
    )


def _plan_of(context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> RenderPlan:
    """Plan the image of the whole region, under the scene's current settings."""
    settings = read_view_settings(depsgraph.scene, context.space_data.shading)
    return plan_view(settings, (context.region.width, context.region.height))
