"""The "Rendered" shading of one region of a 3D viewport: its scene in step, its view refined, its image on the screen.

The trees belong to the cached sync, so all viewports of a Blender scene share them. A view that shows other objects
than the rest (local view, filters by type) has trees of its own.

What needs the native engine is imported where it is used: without it the add-on must still register, and say why.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import bpy

from ..image.plan import RenderPlan, plan_view
from ..image.progressive import Pace, Refinement, View
from ..live.pending_commit import PendingCommit
from ..settings.scene_settings import read_settings
from ..statistics.last_result import confirm_view, edits_of
from ..sync.records import AttributeRequest, CameraRecord
from .awaited_view import begin_view, filter_of
from .region_camera import camera_of
from .screen_image import draw_texture, texture_of
from .view_statistics import remember_view

if TYPE_CHECKING:
    import gpu

    from ..live.scene_sync import SceneSync

# What a redraw may take: little while the view moves, somewhat more while it stands still and is refined.
MOVING_SECONDS = 0.03
REFINING_SECONDS = 0.1


@dataclass(frozen=True, slots=True)
class ViewKey:
    """All that a view's image depends on: as long as it is equal, the image is refined.

    scene_id, revision: of the sync's engine scene, which no other has, and of what it shows.
    """

    scene_id: int
    revision: int
    camera: tuple[Any, ...]
    plan: RenderPlan


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
        self._texture: gpu.types.GPUTexture | None = None
        self.complaint: str | None = None
        """Why the view is not what it should be, as a sentence for the user."""

    # The scene -------------------------------------------------------------------------------------------------------

    def update(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Read an evaluated depsgraph and have the trees brought in step with it. Raises what the engine raises."""
        space = context.space_data
        sync = self._sync_for(space, depsgraph)
        filtering = space if sync is self._own_sync else None
        plan = _plan_of(context, depsgraph)
        self._read_for = plan.attributes
        report = self._trees.begin(
            sync,
            lambda: begin_view(sync, depsgraph, plan, filtering),
            # An animation's next frame would stop what this one has begun: it waits, so that each is shown.
            to_the_end=context.screen.is_animation_playing,
        )
        if report is not None and not report.has_changes:
            confirm_view(depsgraph.scene, sync.last_change)

    def _sync_for(self, space: bpy.types.SpaceView3D, depsgraph: bpy.types.Depsgraph) -> SceneSync:
        from ..live.scene_sync import SceneSync
        from ..live.sync_cache import sync_of

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
        """Work for a bounded time and draw the best image there is; whether there is more to do.

        Raises what the engine raises.
        """
        if self._trees.sync is None or self._needs_other_reading(context, depsgraph):
            self.update(context, depsgraph)
        if not self._trees.are_there(lambda: self.update(context, depsgraph)):
            if self._texture is not None:
                draw_texture(engine, depsgraph.scene, self._texture, (context.region.width, context.region.height))
            return True
        sync = self._trees.sync
        assert sync is not None
        view_is_new = self._follow_view(sync, context, depsgraph)
        refinement = self._refinement
        if refinement is None:
            return False
        was_finished = refinement.is_finished
        if refinement.step(MOVING_SECONDS if view_is_new else REFINING_SECONDS) or self._texture is None:
            self._texture = texture_of(refinement.image, depsgraph.scene.perfect_bvh.mode.lower())
        draw_texture(engine, depsgraph.scene, self._texture, (context.region.width, context.region.height))
        if refinement.is_finished and not was_finished:
            remember_view("Viewport", sync, refinement, depsgraph.scene, edits_of(depsgraph.scene))
        return not refinement.is_finished

    def _needs_other_reading(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> bool:
        """Whether what is wanted has changed, of which the depsgraph tells nothing: the view's filter, the mode."""
        wanted = _plan_of(context, depsgraph).attributes
        return self._shown_filter != filter_of(context.space_data) or self._read_for != wanted

    @property
    def state(self) -> str:
        """How far the view is, as words for the user."""
        if self._trees.state is not None or self._refinement is None:
            return self._trees.state or ""
        done, wanted = self._refinement.sample_count, self._refinement.view.plan.samples
        return f"{'Finished' if self._refinement.is_finished else 'Sample'} {done}/{wanted}"

    def _follow_view(self, sync: SceneSync, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> bool:
        """Start over if what is seen is not what it was; whether it was so."""
        from ..sync.appearance import as_camera

        camera, self.complaint = camera_of(context.region_data, context.space_data, depsgraph)
        if camera is None:
            self._key = self._refinement = None
            return True
        plan = _plan_of(context, depsgraph)
        key = ViewKey(sync.scene.scene_id, sync.revision, _camera_key(camera), plan)
        if key == self._key:
            return False
        self._key = key
        self._refinement = Refinement(View.of(sync, as_camera(camera), plan), self._pace)
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
    """Of the whole region, under the scene's settings as they are now."""
    return plan_view(read_settings(depsgraph.scene, is_viewport=True), (context.region.width, context.region.height))
