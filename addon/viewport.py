"""The "Rendered" shading of one region of a 3D viewport: its scene in step, its view refined, its image on the screen.

The trees belong to the session, so all viewports of a Blender scene share them. A view that shows other objects than
the rest (local view, filters by type) has trees of its own.

What needs the native engine is imported where it is used: without it the add-on must still register, and say why.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import bpy

from .frame import CLAY_GREY, Source, count_pixels, expected_rays, missing_camera, needed_attributes
from .latest import confirm_view, remember
from .modes import find_mode
from .properties import RenderSettings, read_settings
from .refinement import Pace, Refinement, View
from .region_camera import camera_of
from .screen_image import draw_texture, texture_of
from .sync.records import CameraRecord
from .view_statistics import view_statistics

if TYPE_CHECKING:
    import gpu
    from perfect_bvh import Camera

    from .session import SceneSync
    from .sync.report import SyncReport

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


@dataclass(slots=True)
class Content:
    """What a sync shows. Every viewport that shares it compares its revision with that of what it has drawn.

    revision: how often it has changed. report: of the last change.
    """

    revision: int
    report: SyncReport


_contents: WeakKeyDictionary[SceneSync, Content] = WeakKeyDictionary()


@dataclass(frozen=True, slots=True)
class ViewKey:
    """All that a view's image depends on beside the scene's content: as long as it is equal, the image is refined."""

    revision: int
    sync_id: int
    camera: tuple[Any, ...]
    size: tuple[int, int]
    settings: RenderSettings


class Viewport:
    """One region's renderer; lives as long as Blender's engine for the region does."""

    def __init__(self) -> None:
        self._sync: SceneSync | None = None
        self._own_sync: SceneSync | None = None
        self._shown_filter: tuple[bool, ...] = ()
        self._pace = Pace()
        self._key: ViewKey | None = None
        self._refinement: Refinement | None = None
        self._texture: gpu.types.GPUTexture | None = None
        self.complaint: str | None = None
        """Why the view is not what it should be, as a sentence for the user."""

    # The scene -------------------------------------------------------------------------------------------------------

    def update(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Bring the scene's trees in step with an evaluated depsgraph. Raises what the engine raises."""
        space = context.space_data
        sync = self._sync_for(space, depsgraph)
        self._sync = None  # a failed update must not leave an old image on the screen
        filtering = space if sync is self._own_sync else None
        report = _bring_in_step(sync, depsgraph, read_settings(depsgraph.scene), filtering, context.region)
        if not report.has_changes:
            confirm_view(depsgraph.scene)
        self._sync = sync

    def _sync_for(self, space: bpy.types.SpaceView3D, depsgraph: bpy.types.Depsgraph) -> SceneSync:
        from .session import SceneSync, session_of

        self._shown_filter = _filter_of(space)
        if not any(self._shown_filter):
            self._own_sync = None
            return session_of(depsgraph)
        if self._own_sync is None:
            self._own_sync = SceneSync(watch=False)
        return self._own_sync

    # The image -------------------------------------------------------------------------------------------------------

    def draw(self, engine: bpy.types.RenderEngine, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> bool:
        """Work for a bounded time and draw the best image there is; whether there is more to do.

        Raises what the engine raises.
        """
        if self._sync is None or self._shown_filter != _filter_of(context.space_data):
            self.update(context, depsgraph)
        view_is_new = self._follow_view(context, depsgraph)
        refinement = self._refinement
        if refinement is None:
            return False
        was_finished = refinement.is_finished
        if refinement.step(MOVING_SECONDS if view_is_new else REFINING_SECONDS) or self._texture is None:
            self._texture = texture_of(refinement.image, depsgraph.scene.perfect_bvh.mode.lower())
        draw_texture(engine, depsgraph.scene, self._texture, (context.region.width, context.region.height))
        if refinement.is_finished and not was_finished:
            remember_view("Viewport", self._sync, refinement, depsgraph.scene)
        return not refinement.is_finished

    @property
    def progress(self) -> tuple[int, int]:
        """(samples done, samples wanted)."""
        return (self._refinement.sample_count, self._refinement.view.samples) if self._refinement else (0, 0)

    def _follow_view(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> bool:
        """Begin anew if what is seen is not what it was; whether it was so."""
        assert self._sync is not None
        scene, region = depsgraph.scene, context.region
        camera, self.complaint = camera_of(context.region_data, context.space_data, depsgraph)
        if camera is None:
            self._key = self._refinement = None
            return True
        settings = read_settings(scene)
        size = (region.width, region.height)
        key = ViewKey(_contents[self._sync].revision, id(self._sync), _camera_key(camera), size, settings)
        if key == self._key:
            return False
        self._key = key
        self._refinement = Refinement(_view_of(self._sync, as_camera(camera), size, settings), self._pace)
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


def refine_view(context: bpy.types.Context, settings: RenderSettings, pace: Pace) -> tuple[SceneSync, Refinement]:
    """The image of what `find_view` finds, or else of what the scene's camera sees, not begun yet; and its scene.

    Raises ValueError if there is neither, and what the engine raises.
    """
    from .session import SceneSync, session_of

    depsgraph = context.evaluated_depsgraph_get()
    found = find_view(context)
    is_filtered = found is not None and any(_filter_of(found[0]))
    sync = SceneSync(watch=False) if is_filtered else session_of(depsgraph)
    filtering = found[0] if found is not None and is_filtered else None
    _bring_in_step(sync, depsgraph, settings, filtering, None if found is None else found[1])
    if found is None:
        if sync.camera is None:
            raise ValueError(missing_camera(depsgraph.scene, sync))
        return sync, Refinement(_view_of(sync, sync.camera, _scaled(sync.size, context.scene), settings), pace)
    space, region = found
    camera, _ = camera_of(space.region_3d, space, depsgraph)
    if camera is None:
        raise ValueError("the 3D viewport has no usable view: its matrix is not finite")
    size = _scaled((region.width, region.height), context.scene)
    return sync, Refinement(_view_of(sync, as_camera(camera), size, settings), pace)


def remember_view(source: Source, sync: SceneSync, refinement: Refinement, scene: bpy.types.Scene) -> None:
    """Leave for the panels what a view's image took, which still shows what `sync` holds."""
    report = _contents[sync].report
    remember(scene, view_statistics(source, sync, report, refinement, read_settings(scene), scene.frame_current_final))


def _scaled(size: tuple[int, int], scene: bpy.types.Scene) -> tuple[int, int]:
    """What the Preview button makes of a size."""
    percentage = scene.perfect_bvh.preview_percentage
    width, height = (max(1, round(length * percentage / 100)) for length in size)
    return width, height


def bring_in_step(depsgraph: bpy.types.Depsgraph) -> SceneSync:
    """The session's sync of what a viewport depsgraph shows, brought in step for whoever needs nothing but its trees.

    Raises what the engine raises.
    """
    from .session import session_of

    sync = session_of(depsgraph)
    _note_changes(sync, sync.update(depsgraph))
    return sync


def _bring_in_step(
    sync: SceneSync,
    depsgraph: bpy.types.Depsgraph,
    settings: RenderSettings,
    space: bpy.types.SpaceView3D | None,
    region: bpy.types.Region | None,
) -> SyncReport:
    """space: the viewport whose filters count; none do for the trees that all share, whoever has them brought in step.

    region: None for the camera's view in the size of a render.
    """
    sync.request(needed_attributes(settings, ()))
    pixel_count = count_pixels(depsgraph) if region is None else region.width * region.height
    report = sync.update(depsgraph, expected_rays(settings, pixel_count), space=space)
    _note_changes(sync, report)
    return report


def _note_changes(sync: SceneSync, report: SyncReport) -> None:
    if sync not in _contents:
        _contents[sync] = Content(1, report)
    elif report.has_changes:
        _contents[sync].revision += 1
        _contents[sync].report = report


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
    )


def as_camera(record: CameraRecord) -> Camera:
    """The engine's camera of a record."""
    import perfect_bvh

    return perfect_bvh.Camera(
        matrix=record.matrix,
        window=record.window,
        projection=record.projection,
        clip_start=record.clip_start,
        clip_end=record.clip_end,
        border=record.border,
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
