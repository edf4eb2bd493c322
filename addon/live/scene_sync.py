"""`SceneSync`: a Blender scene and the engine's copy of it, in step.

import bpy, perfect_bvh_addon

sync = perfect_bvh_addon.SceneSync()
sync.update(bpy.context.evaluated_depsgraph_get())
hits = sync.scene.cast_rays(origins, directions)
names = sync.describe(hits.instance_ids).names
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from perfect_bvh import Scene
from perfect_bvh._arrays import share_of

from ..extract import ReadCache, read_scene
from ..extract.pointer_views import ArrayReader
from ..extract.scene_in_time import FrameSet, Shutter, as_shutter, read_scene_in_time
from ..support.background_work import BackgroundWork
from ..sync.motion import without_parting
from ..sync.plan import find_mismatches
from ..sync.records import AttributeRequest, SceneRecord
from ..sync.report import SyncReport
from ..sync.scene_difference import AppliedDifference, SceneDifference
from ..sync.state import SceneState, TimedCommit
from .synced_scene import SceneWatch, SyncedScene

Progress = Callable[[float], object]
UpdateCommit = BackgroundWork[TimedCommit, SyncReport]

_FAILED = "the last update did not succeed: call update() again"
_CLOSED = "the sync was closed: call update()"


class SceneSync(SyncedScene):
    """Keeps an engine scene in step with a Blender scene. Only `update()` reads Blender.

    Use it on Blender's main thread. Snapshots of its scene may be traced on any thread, and never become stale.

    These are changes: anything that Blender evaluates again, a frame, an undo, a file, another scene or view layer in
    the window, and handlers that a script removed. A query on the main thread first lets Blender evaluate pending
    changes (microseconds if there are none), so an edit counts at once. Other threads, handlers, drivers and renders
    must not start an evaluation. A query there uses the last evaluation, and raises from the moment when an
    evaluation, a frame change or an undo begins. Blender itself does not notice some changes until something is
    evaluated for another reason, for renders and viewports as well: custom properties (`object["x"] = 1`, inputs of
    geometry nodes) until `object.update_tag()`, and in Blender 4.2 `foreach_set` until `mesh.update()`.

    Args:
        attributes: The data to read in addition to triangles; by default the material slots. `request()` adds more
            later.
        for_viewport: Whether viewport or render visibility counts; by default the purpose of each depsgraph decides.
        watch: Whether queries raise `perfect_bvh.StaleSceneError` if anything has changed in Blender since the
            last update: see above. This installs Blender handlers until the last such sync is closed, with or
            without `register()`. False is for renders, which have their own depsgraph.
    """

    def __init__(
        self,
        attributes: AttributeRequest | None = None,
        *,
        for_viewport: bool | None = None,
        watch: bool = True,
    ) -> None:
        self._attributes = attributes or AttributeRequest()
        self._for_viewport = for_viewport
        self._watch = SceneWatch() if watch else None
        self._make_scene = Scene if self._watch is None else self._watch.make_scene
        self._state = SceneState(self._make_scene)
        self._cache = ReadCache()
        self._lookup = self._appearance = None
        self._building: UpdateCommit | None = None
        self._tree_byte_count = 0
        self.revision = 0
        """The number of updates so far that changed anything that an image could show."""
        self.last_change: SyncReport | None = None
        """The report of the last update that did."""
        self._state.scene.mark_stale("nothing was synced yet: call update()")
        if self._watch is not None:
            self._watch.start()

    def request(self, attributes: AttributeRequest, *, only: bool = False) -> None:
        """Adds attributes to those that the following updates read; only: they read no others any more."""
        asked = (attributes,) if only else (attributes, self._attributes)
        self._attributes = AttributeRequest(
            material_slots=any(request.material_slots for request in asked),
            corner_normals=any(request.corner_normals for request in asked),
            corner_uvs=any(request.corner_uvs for request in asked),
            shading=any(request.shading for request in asked),
        )

    def update(
        self,
        depsgraph: Any,
        expected_rays: int | None = None,
        verify: bool = False,
        *,
        camera: Any = None,
        size: tuple[int, int] | None = None,
        space: Any = None,
        shutter: tuple[float, float] | None = None,
        steps: int | None = None,
        frame_set: FrameSet | None = None,
        progress: Progress | None = None,
    ) -> SyncReport:
        """Makes the engine's scene equal to an evaluated `bpy.types.Depsgraph`, editing only what differs.

        With a shutter Blender evaluates each time sample of any object or the camera once. It is then set back to its
        frame and subframe, even if the update fails. As after any change of the frame, keyed properties then have the
        values of their keys. Objects and cameras have Cycles' switches *Motion Blur* and *Deformation* and steps
        (2 ** steps + 1 time samples), instances those of their instancer as well; where Cycles is disabled all are on.
        Objects move, instances (identified by their persistent ids), and the vertices of meshes, hair, curves and
        points. `perfect_bvh.Scene.set_instance_motion` and `set_mesh_motion` describe the motion between two time
        samples. `camera_motion` has the camera's. Objects that have other triangles, or do not exist, at one of their
        time samples do not move: they are shown as at the frame, and are listed in `warnings` and `report.not_shown`.
        Lights, materials and world are the frame's.

        Args:
            expected_rays: The expected number of rays until the next update. Builds and refits are weighed against it.
                The default is the number that the last update was given (unless 0), or the number of rays cast since
                the last update if that is larger. If no update was ever given a number, the class of a mesh selects its
                builder, or a better one if the rays cast since repay it, and a refitted tree is restructured when 5
                percent worse. A mesh that does not change gets a better tree in some later update, even if nothing has
                changed, once its rays repay one: see `perfect_bvh.Scene.commit`.
            verify: Reads the frame itself a second time in the slow and certain way, and reports each difference; no
                other time sample of a shutter.
            camera: An object or a `CameraRecord` instead of the scene's camera, or a function of the depsgraph that
                returns a record or None.
            size: (width, height) in pixels instead of the render size.
            space: The `SpaceView3D` whose local view counts.
            shutter: (begin, end), in frames from the current one, which become the times 0 and 1 of the queries.
                Objects move during that interval, see above. None ends all motions.
            steps: 2 to 255, the number of time samples for objects whose *Motion Steps* were never set in Cycles; 3 by
                default.
            frame_set: Called with a frame and a subframe, 0 to below 1, instead of the scene's own method. A render
                needs its engine's `frame_set`, because only that evaluates its depsgraph.
            progress: Called with the share done of the commit, which follows the shutter's time samples; returning
                False raises `perfect_bvh.Cancelled`.

        Raises:
            ValueError: For invalid arguments, and the errors of the engine. Until an update succeeds,
                queries then raise `perfect_bvh.StaleSceneError`.
        """
        span = as_shutter("update", shutter, steps, frame_set)
        self.stop_building()
        self._state.scene.mark_stale(_FAILED)
        view = {"camera": camera, "size": size, "space": space}
        if self._watch is not None:
            self._watch.start()  # again, if it was closed
            self._watch.settle(depsgraph)
        reading = share_of(progress, 0.0, 0.5)
        committing = progress if span is None else share_of(progress, 0.5, 0.5)
        difference, read_milliseconds = self._read(lambda: self._read_any(depsgraph, view, span, reading))
        if self._watch is not None:
            self._watch.settle(depsgraph)  # reading images makes some for a moment
            self._watch.note_synced(depsgraph)
        state = self._state
        applied = self._apply(difference)
        report = self._finish(state, applied, state.commit(expected_rays, committing), read_milliseconds)
        if verify:
            certain = self._read_record(depsgraph, view, reader=ArrayReader(use_views=False))
            report = replace(report, mismatches=find_mismatches(without_parting(self.record), certain))
        return report

    def begin_update(
        self,
        depsgraph: Any,
        expected_rays: int | None = None,
        *,
        camera: Any = None,
        size: tuple[int, int] | None = None,
        space: Any = None,
        shutter: tuple[float, float] | None = None,
        steps: int | None = None,
        frame_set: FrameSet | None = None,
    ) -> UpdateCommit:
        """Does the half of `update` that needs Blender; returns the other half, which runs by itself: see `building`.

        Args:
            expected_rays: See `update`, also for the other arguments. A commit in progress that is returned keeps
                its own number. The read data (`record`, `camera`, `warnings`) is available at once. All methods that
                use the engine raise `perfect_bvh.StaleSceneError` until the commit has succeeded; its `result` is the
                report. Only one commit runs at a time. If an earlier one builds the data that was read now, it is
                returned; any other is stopped, also by `update`.

        Raises:
            RuntimeError: For a sync that watches Blender: a change between the two halves would be lost when the
                commit begins, and outdated answers would be accepted. Code that updates in halves must look for changes
                itself.
        """
        if self._watch is not None:
            raise RuntimeError("begin_update: the sync watches Blender; create it with watch=False")
        span = as_shutter("begin_update", shutter, steps, frame_set)
        view = {"camera": camera, "size": size, "space": space}
        return self._begin(lambda: self._read_any(depsgraph, view, span), expected_rays)

    def _begin(self, read: Callable[[], SceneRecord], expected_rays: int | None) -> UpdateCommit:
        """Does the work of `begin_update` for any function that reads Blender."""
        if self._building is not None and self._building.is_lost:
            self.stop_building()  # before anything is compared with the data that it held
        try:
            difference, read_milliseconds = self._read(read)
        except BaseException:
            self.stop_building()
            self._state.scene.mark_stale(_FAILED)
            raise
        building = self.building  # asked for once: it may end at any time
        if building is not None and building.is_wanted and difference.is_none:
            return building
        self.stop_building()
        state = self._state
        applied = self._apply(difference)
        self._building = BackgroundWork(
            lambda progress: state.commit(expected_rays, progress),
            lambda commit: self._finish(state, applied, commit, read_milliseconds),
        )
        return self._building

    def _read(self, read: Callable[[], SceneRecord]) -> tuple[SceneDifference, float]:
        """Begins an update: returns the difference of Blender's scene from the held one, and milliseconds to read."""
        started = time.perf_counter()
        record = read()
        read_milliseconds = (time.perf_counter() - started) * 1e3
        return self._state.compare(record), read_milliseconds

    def _read_any(
        self, depsgraph: Any, view: dict[str, Any], shutter: Shutter | None, progress: Progress | None = None
    ) -> SceneRecord:
        if shutter is None:
            return self._read_record(depsgraph, view, cache=self._cache)
        how = {"for_viewport": self._for_viewport, **view}
        return read_scene_in_time(depsgraph, shutter, self._attributes, self._cache, progress=progress, **how)

    def _read_record(self, depsgraph: Any, view: dict[str, Any], **how: Any) -> SceneRecord:
        return read_scene(depsgraph, self._attributes, for_viewport=self._for_viewport, **view, **how)

    def _apply(self, difference: SceneDifference) -> AppliedDifference:
        self._lookup = self._appearance = None
        return self._state.apply(difference)

    def _finish(
        self, state: SceneState, applied: AppliedDifference, commit: TimedCommit, read_milliseconds: float
    ) -> SyncReport:
        """Finishes an update when its commit has succeeded. If this fails, so does the update."""
        try:
            return self._take_in(state.finish(applied, commit, read_milliseconds))
        except BaseException:
            state.scene.mark_stale(_FAILED)
            raise

    # The half that goes on by itself ---------------------------------------------------------------------------------

    @property
    def building(self) -> UpdateCommit | None:
        """The commit that is under way, None if there is none."""
        if self._building is not None and not self._building.is_running:
            self.stop_building()
        return self._building

    def ask_to_stop_building(self) -> None:
        """Requests a stop, from any thread, without waiting."""
        building = self._building
        if building is not None:
            building.ask_to_stop()

    def stop_building(self) -> None:
        """Stops the commit that is under way, if there is one; its edits then wait for the next update."""
        building = self._building
        if building is None:
            return
        building.stop()
        self._building = None
        if building.is_lost:  # in a forked process, where its scene stays locked
            self._start_over("the process was forked during an update: call update()")

    def _take_in(self, report: SyncReport) -> SyncReport:
        """Stores the report and state of a successful update."""
        self._tree_byte_count = report.byte_count
        self._lookup = None  # the old lookup lacks the new data
        if report.has_changes or self.last_change is None:
            self.revision += 1
            self.last_change = report
        return report

    def close(self) -> None:
        """Forgets the scene and stops watching; queries raise from now on. Updating again is allowed."""
        if self._watch is not None:
            self._watch.stop()
        self.stop_building()
        self.last_change = None
        self._state.scene.mark_stale(_CLOSED)  # for those that hold it; the next update makes another
        self._start_over(_CLOSED)

    def _start_over(self, why: str) -> None:
        self._state = SceneState(self._make_scene)
        self._cache = ReadCache()
        self._lookup = self._appearance = None
        self._state.scene.mark_stale(why)
