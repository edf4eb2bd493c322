"""When viewports are redrawn while the mouse does not move: when there is something new, and not too often.

A redraw takes the processor from the tracer, without a graphics card most of a tenth of a second. So the cost of
redraws is measured, and there is a pause of several times that after each. All of this is on Blender's main thread, in
a timer that runs only while a viewport works on its image. Finished images are shown at once, and so are denoised ones:
these come seldom, whenever samples have doubled, and are much better than the previous image.
"""

from __future__ import annotations

import time
import weakref
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import bpy

from ...events.changes import listen, stop_listening
from ...image.plan import RenderPlan, plan_render, plan_view
from ...image.progressive import Pace
from ...image.refinement import Refinement, View
from ...image.still import missing_camera
from ...settings.scene_settings import ENGINE_NAME, RenderSettings, read_settings
from ...settings.shading_settings import AS_RENDER, mode_of
from ...statistics import not_shown
from ...statistics.last_result import edits_of
from ...sync.not_shown import without_looks
from .screen import camera_of
from .view_lighting import ViewLighting, lighting_of

if TYPE_CHECKING:
    from perfect_bvh import Camera

    from ...live.scene_sync import SceneSync, UpdateCommit


# Of all time, what redraws for the sake of new images may take.
SHARE = 0.1
LONGEST_PAUSE = 3.0  # after a redraw that took very long for once
TICK_SECONDS = 0.02
# A region that is hidden is not drawn, however often that is asked for.
ASKING_SECONDS = 1.0


@dataclass(slots=True)
class RedrawBudget:
    """Decides how often to redraw, from the cost of the last redraw. Times are of any monotonic clock."""

    pause: float = 0.0
    """Seconds that lie between two redraws."""
    _begun: float | None = None
    _ended: float = float("-inf")

    def begin(self, now: float) -> None:
        """A redraw was asked for."""
        self._begun = now

    def end(self, now: float) -> None:
        """It is over, if one was under way."""
        if self._begun is None:
            return
        self.pause = min((now - self._begun) * (1.0 / SHARE - 1.0), LONGEST_PAUSE)
        self._begun, self._ended = None, now

    def allows(self, now: float) -> bool:
        """Whether it is time for another."""
        return self._begun is None and now >= self._ended + self.pause


class Traced(Protocol):
    """A viewport, as far as redraws are concerned. asked_at: when a redraw of it was last asked for."""

    asked_at: float

    @property
    def region_pointer(self) -> int:
        """The address of the region that is drawn."""

    @property
    def is_working(self) -> bool:
        """Whether more of its image is to come."""

    @property
    def has_news(self) -> bool:
        """Whether its image is better than the drawn one."""

    @property
    def is_denoised(self) -> bool:
        """Whether it is one without noise."""

    @property
    def has_ended(self) -> bool:
        """Whether it is as good as it gets."""

    def stop(self) -> None:
        """Have it traced no further; from any thread."""

    def visits_at(self, place: tuple[int, int]) -> tuple[int, int] | None:
        """Returns the nodes and triangles that a pixel's camera ray visits; None outside the image."""


budget = RedrawBudget()
_viewports: weakref.WeakSet[Traced] = weakref.WeakSet()


def watch(viewport: Traced) -> None:
    """It works on its image: it is drawn again when there is news of that, and for as long as it exists."""
    _viewports.add(viewport)
    if not bpy.app.background and not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=TICK_SECONDS, persistent=True)


def viewport_at(region_pointer: int) -> Traced | None:
    """The viewport that was drawn into a region last, by the address of that."""
    found = [viewport for viewport in _viewports if viewport.region_pointer == region_pointer]
    return found[0] if len(found) == 1 else None


def _tick() -> float | None:
    now = time.perf_counter()
    budget.end(now)  # Blender draws between two looks of a timer
    working = [viewport for viewport in _viewports if viewport.is_working]
    if not working:
        return None
    if _is_playing():  # the next frame comes by itself
        return TICK_SECONDS
    news = [viewport for viewport in working if viewport.has_news and now >= viewport.asked_at + ASKING_SECONDS]
    if not news or not (budget.allows(now) or any(viewport.has_ended or viewport.is_denoised for viewport in news)):
        return TICK_SECONDS
    regions = {viewport.region_pointer for viewport in news}
    for viewport in news:
        viewport.asked_at = now
    if _tag(regions):
        budget.begin(now)
        return 0.0
    return TICK_SECONDS


def _is_playing() -> bool:
    return any(window.screen.is_animation_playing for window in bpy.context.window_manager.windows)


def _tag(regions: set[int]) -> bool:
    """Have regions drawn, by their addresses; whether any of them is there."""
    found = False
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            for region in area.regions if area.type == "VIEW_3D" else ():
                if region.as_pointer() in regions:
                    region.tag_redraw()
                    found = True
    return found


def stop_all() -> None:
    """Have no viewport trace any more, until it is drawn again; from any thread."""
    for viewport in _viewports.copy():
        viewport.stop()


class _Watcher:
    """Stops tracing images that were undone or whose file was closed."""

    def on_change(self, what: str) -> None:
        if what in {"a step was undone", "a step was redone"}:
            stop_all()

    def on_file_change(self) -> None:
        stop_all()


_watcher = _Watcher()


def register() -> None:
    listen(_watcher)


def unregister() -> None:
    stop_listening(_watcher)
    stop_all()
    _viewports.clear()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)


# Awaited view --------------------------------------------------------------------------------------------------------
# One view of a scene: which one it is, what its trees must hold, and its image once they are there.
#
# What needs the native engine is imported where it is used: without it the add-on must still register, and say why.


TYPE_FILTERS = (
    "show_object_viewport_mesh",
    "show_object_viewport_curve",
    "show_object_viewport_surf",
    "show_object_viewport_meta",
    "show_object_viewport_font",
)


def find_view(context: bpy.types.Context) -> tuple[bpy.types.SpaceView3D, bpy.types.Region] | None:
    """Returns the current 3D viewport, or else the largest in the window; None if none is visible."""
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
    """One view of a scene that was read, and whose trees are being built.

    camera: None for the scene's. edits: of the scene, when it was read. has_own_mode: whether it is the viewport's and
    not the scene's.
    """

    sync: SceneSync
    building: UpdateCommit
    camera: Camera | None
    plan: RenderPlan
    edits: int
    lighting: ViewLighting
    has_own_mode: bool = False

    def refine(self, pace: Pace) -> Refinement:
        """Returns the unstarted image. Waits for the trees; raises the engine's errors, `Cancelled` without any."""
        import perfect_bvh

        self.building.result()
        if not self.sync.scene.is_current:
            raise perfect_bvh.Cancelled("another view has other trees built")
        camera = self.camera or self.sync.camera
        assert camera is not None
        view = View.of(self.sync, camera, self.plan)
        lit = self.lighting.light(view.appearance, self.sync.record.lights.of_world)
        return Refinement(replace(view, appearance=lit), pace)


def await_view(context: bpy.types.Context) -> AwaitedView:
    """Awaits the view from `find_view`, or else from the scene's camera: read now, built while Blender continues.

    A viewport that this engine renders is shown in its own mode and under its own light, anything else in the scene's.

    Raises ValueError if there is neither, and the engine's errors.
    """
    from ...live.scene_sync import SceneSync
    from ...live.sync_cache import sync_of
    from ...sync.appearance import as_camera

    depsgraph = context.evaluated_depsgraph_get()
    found = find_view(context)
    is_filtered = found is not None and any(filter_of(found[0]))
    sync = SceneSync(watch=False) if is_filtered else sync_of(depsgraph)
    filtering = found[0] if found is not None and is_filtered else None
    edits = edits_of(context.scene)
    if found is None:
        settings = read_settings(context.scene)
        plan = _scaled(plan_render(depsgraph.scene, settings), context.scene)
        building = begin_view(sync, depsgraph, plan, None)
        _tell_of(sync, depsgraph, plan)
        if sync.camera is None:
            building.stop()
            raise ValueError(missing_camera(depsgraph.scene, sync))
        return AwaitedView(sync, building, None, plan, edits, ViewLighting())
    space, region = found
    settings, lighting, has_own_mode = _look_of(space.shading, depsgraph.scene)
    plan = _scaled(plan_view(settings, (region.width, region.height)), context.scene)
    building = begin_view(sync, depsgraph, plan, filtering)
    _tell_of(sync, depsgraph, plan)
    camera, _ = camera_of(space.region_3d, space, depsgraph)
    if camera is None:
        building.stop()
        raise ValueError("the 3D viewport has no usable view: its matrix is not finite")
    return AwaitedView(sync, building, as_camera(camera), plan, edits, lighting, has_own_mode)


def _look_of(shading: bpy.types.View3DShading, scene: bpy.types.Scene) -> tuple[RenderSettings, ViewLighting, bool]:
    """Returns a viewport's settings for a scene, its light, and whether it has its own mode."""
    settings = read_settings(scene)
    if shading.type != "RENDERED" or scene.render.engine != ENGINE_NAME:
        return settings, ViewLighting(), False
    has_own_mode = shading.perfect_bvh.mode != AS_RENDER
    return replace(settings, mode=mode_of(scene, shading)), lighting_of(shading, scene), has_own_mode


def _scaled(plan: RenderPlan, scene: bpy.types.Scene) -> RenderPlan:
    """Scales the plan to the size of the image that the view is rendered to."""
    percentage = scene.perfect_bvh.preview_percentage
    width, height = (max(1, round(length * percentage / 100)) for length in plan.size)
    return plan_view(plan.settings, (width, height))


def begin_view(
    sync: SceneSync, depsgraph: bpy.types.Depsgraph, plan: RenderPlan, space: bpy.types.SpaceView3D | None
) -> UpdateCommit:
    """Reads a scene with the data that the plan of a view needs, and builds its trees.

    space: the viewport whose filters count; none do for the shared trees, for any view that updates them.
    """
    sync.request(plan.attributes)
    return sync.begin_update(depsgraph, plan.expected_rays, space=space)


def _tell_of(sync: SceneSync, depsgraph: bpy.types.Depsgraph, plan: RenderPlan) -> None:
    """Reports what the image will lack. Views that share the trees may have read more than this one needs."""
    read = sync.record.not_shown
    not_shown.tell(depsgraph.scene, read if plan.attributes.shading else without_looks(read))


def filter_of(space: bpy.types.SpaceView3D) -> tuple[bool, ...]:
    """Returns the settings by which a viewport shows other objects than the rest; all False without any."""
    hidden_types = (not getattr(space, name) for name in TYPE_FILTERS)
    return (space.local_view is not None, space.use_local_collections, *hidden_types)
