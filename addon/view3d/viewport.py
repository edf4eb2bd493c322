"""The "Rendered" shading of one region of a 3D viewport: its scene in step, its view refined, its image on the screen.

The trees belong to the cached sync, so all viewports of a Blender scene share them. A view that shows other objects than
the rest (local view, filters by type) has trees of its own.

What needs the native engine is imported where it is used: without it the add-on must still register, and say why.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import bpy

from ..image.progressive import Pace, Refinement, View
from ..image.still import CLAY_GREY, count_pixels, expected_rays, missing_camera, needed_attributes
from ..live.pending_commit import PendingCommit
from ..settings.modes import find_mode
from ..settings.scene_settings import RenderSettings, read_settings
from ..statistics.last_result import confirm_view
from ..sync.records import AttributeRequest, CameraRecord
from .region_camera import camera_of
from .screen_image import draw_texture, texture_of
from .view_statistics import Moment, remember_view

if TYPE_CHECKING:
    import gpu
    from perfect_bvh import Camera

    from ..live.scene_sync import SceneSync, UpdateCommit

# What a redraw may take: little while the view moves, somewhat more while it stands still and is refined.
MOVING_SECONDS = 0.03
REFINING_SECONDS = 0.1
TYPE_FILTERS = (
    "show_object_viewport_mesh",
    "show_object_viewport_curve",
    "show_object_viewport_surf",
    "show_object_viewport_meta",
    "show_object_viewport_font",
)


@dataclass(frozen=True, slots=True)
class ViewKey:
    """All that a view's image depends on: as long as it is equal, the image is refined.

    scene_id, revision: of the sync's engine scene, which no other has, and of what it shows.
    """

    scene_id: int
    revision: int
    camera: tuple[Any, ...]
    size: tuple[int, int]
    settings: RenderSettings


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
        settings = read_settings(depsgraph.scene)
        self._read_for = needed_attributes(settings, ())
        report = self._trees.begin(
            sync,
            lambda: begin_update(sync, depsgraph, settings, filtering, context.region),
            # An animation's next frame would stop what this one has begun: it waits, so that each is shown.
            to_the_end=context.screen.is_animation_playing,
        )
        if report is not None and not report.has_changes:
            confirm_view(depsgraph.scene, sync.last_change)

    def _sync_for(self, space: bpy.types.SpaceView3D, depsgraph: bpy.types.Depsgraph) -> SceneSync:
        from ..live.scene_sync import SceneSync
        from ..live.sync_cache import sync_of

        self._shown_filter = _filter_of(space)
        if not any(self._shown_filter):
            if self._own_sync is not None:
                self._own_sync.ask_to_stop_building()  # for nobody any more
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
            remember_view("Viewport", sync, refinement, depsgraph.scene, Moment.now(depsgraph.scene))
        return not refinement.is_finished

    def _needs_other_reading(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> bool:
        """Whether what is wanted has changed, of which the depsgraph tells nothing: the view's filter, the mode."""
        wanted = needed_attributes(read_settings(depsgraph.scene), ())
        return self._shown_filter != _filter_of(context.space_data) or self._read_for != wanted

    @property
    def state(self) -> str:
        """How far the view is, as words for the user."""
        if self._trees.state is not None or self._refinement is None:
            return self._trees.state or ""
        done, wanted = self._refinement.sample_count, self._refinement.view.samples
        return f"{'Finished' if self._refinement.is_finished else 'Sample'} {done}/{wanted}"

    def _follow_view(self, sync: SceneSync, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> bool:
        """Begin anew if what is seen is not what it was; whether it was so."""
        from ..sync.appearance import as_camera

        scene, region = depsgraph.scene, context.region
        camera, self.complaint = camera_of(context.region_data, context.space_data, depsgraph)
        if camera is None:
            self._key = self._refinement = None
            return True
        settings = read_settings(scene)
        size = (region.width, region.height)
        key = ViewKey(sync.scene.scene_id, sync.revision, _camera_key(camera), size, settings)
        if key == self._key:
            return False
        self._key = key
        self._refinement = Refinement(_view_of(sync, as_camera(camera), size, settings), self._pace)
        return True


# One view, for whoever draws it elsewhere ----------------------------------------------------------------------------


def find_view(context: bpy.types.Context) -> tuple[bpy.types.SpaceView3D, bpy.types.Region] | None:
    """The current 3D viewport, or else the largest in the window; None if there is none that anybody sees."""
    if bpy.app.background or context.window is None:
        return None
    areas = [area for area in context.window.screen.areas if area.type == "VIEW_3D"]
    if context.area in areas:
        areas = [context.area]
    if not areas:
        return None
    area = max(areas, key=lambda area: area.width * area.height)
    return area.spaces.active, next(region for region in area.regions if region.type == "WINDOW")


@dataclass(frozen=True, slots=True)
class AwaitedView:
    """One view of a scene that was read, and whose trees are being built. camera: None for the scene's."""

    sync: SceneSync
    building: UpdateCommit
    camera: Camera | None
    size: tuple[int, int]
    moment: Moment

    def refine(self, pace: Pace) -> Refinement:
        """The image, not begun yet. Waits for the trees; raises what the engine raises, `Cancelled` without any."""
        import perfect_bvh

        self.building.result()
        if not self.sync.scene.is_current:
            raise perfect_bvh.Cancelled("somebody else has other trees built")
        camera = self.camera or self.sync.camera
        assert camera is not None
        return Refinement(_view_of(self.sync, camera, self.size, self.moment.settings), pace)


def await_view(context: bpy.types.Context) -> AwaitedView:
    """Of what `find_view` finds, or else of what the scene's camera sees: read now, built while Blender goes on.

    Raises ValueError if there is neither, and what the engine raises.
    """
    from ..live.scene_sync import SceneSync
    from ..live.sync_cache import sync_of
    from ..sync.appearance import as_camera

    depsgraph = context.evaluated_depsgraph_get()
    found = find_view(context)
    is_filtered = found is not None and any(_filter_of(found[0]))
    sync = SceneSync(watch=False) if is_filtered else sync_of(depsgraph)
    filtering = found[0] if found is not None and is_filtered else None
    moment = Moment.now(context.scene)
    building = begin_update(sync, depsgraph, moment.settings, filtering, None if found is None else found[1])
    if found is None:
        if sync.camera is None:
            building.stop()
            raise ValueError(missing_camera(depsgraph.scene, sync))
        return AwaitedView(sync, building, None, _scaled(sync.size, context.scene), moment)
    space, region = found
    camera, _ = camera_of(space.region_3d, space, depsgraph)
    if camera is None:
        building.stop()
        raise ValueError("the 3D viewport has no usable view: its matrix is not finite")
    size = _scaled((region.width, region.height), context.scene)
    return AwaitedView(sync, building, as_camera(camera), size, moment)


def _scaled(size: tuple[int, int], scene: bpy.types.Scene) -> tuple[int, int]:
    """What the Preview button makes of a size."""
    percentage = scene.perfect_bvh.preview_percentage
    width, height = (max(1, round(length * percentage / 100)) for length in size)
    return width, height


def begin_update(
    sync: SceneSync,
    depsgraph: bpy.types.Depsgraph,
    settings: RenderSettings,
    space: bpy.types.SpaceView3D | None,
    region: bpy.types.Region | None,
) -> UpdateCommit:
    """Has a scene read with what its settings need, and its trees built.

    space: the viewport whose filters count; none do for the trees that all share, whoever has them brought in step.
    region: None for the camera's view in the size of a render.
    """
    sync.request(needed_attributes(settings, ()))
    pixel_count = count_pixels(depsgraph) if region is None else region.width * region.height
    return sync.begin_update(depsgraph, expected_rays(settings, pixel_count), space=space)


def _filter_of(space: bpy.types.SpaceView3D) -> tuple[bool, ...]:
    """What makes a viewport show other objects than the rest do; all False where nothing does."""
    hidden_types = (not getattr(space, name) for name in TYPE_FILTERS)
    return (space.local_view is not None, space.use_local_collections, *hidden_types)


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


def _view_of(sync: SceneSync, camera: Camera, size: tuple[int, int], settings: RenderSettings) -> View:
    return View(
        snapshot=sync.scene.snapshot(),
        appearance=sync.appearance,
        camera=camera,
        size=size,
        mode=settings.mode,
        samples=1 if find_mode(settings.mode).has_range else settings.samples,
        options={
            "threads": settings.threads,
            "precision": settings.precision,
            "ao_distance": settings.ao_distance or None,
            "clay_color": None if settings.use_material_colors else CLAY_GREY,
        },
    )
