"""The Scan button: casts the rays that the panel describes and makes a point cloud, or files, of their hits.

In a window it works in steps of a timer while Blender continues, builds trees in the background, and Esc cancels it at
any time. The scene does not change before the end, while files of whole chunks stay.
Without one, or when a script calls it, it does the same in one go.
"""

from __future__ import annotations

import time
from collections.abc import Generator
from typing import TYPE_CHECKING, Any, ClassVar

import bpy

from ..settings.scan_settings import label_names
from ..statistics import messages
from ..statistics.words import count_of, duration
from .piece_jobs import JobOperator, PiecesJob, prepare_free_folder, saved_at_the_users_frame
from .scan_request import (
    ScannedFile,
    check_colors,
    exclude_mount_of,
    folder_of,
    frames_of,
    plan_of,
    threads_of,
)

if TYPE_CHECKING:
    from ..pieces.piece import Piece
    from ..scanning import PointCloud
    from ..scanning.outcomes import RayCounts


class PERFECT_BVH_OT_scan(JobOperator, bpy.types.Operator):
    """Steps through a scan in a timer."""

    bl_idname = "perfect_bvh.scan"
    bl_label = "Scan"
    bl_description = "Cast the sensor's rays and save their hits as a point cloud or files. Esc cancels"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    # Blender evaluates these annotations, and the scanner's module needs the native engine.
    _file: Any
    _colors: tuple[str, str]
    doing = "Scanning"

    @classmethod
    def _find_complaint(cls, context: bpy.types.Context) -> str | None:
        from ..extract.camera import has_camera

        scene = context.scene
        settings = scene.perfect_bvh.scan
        if context.mode != "OBJECT":
            return "Switch to Object Mode first: the points are added as an object"
        if settings.sensor is None and not has_camera(scene):
            return "No sensor: choose a Sensor Object, or add a camera"
        if not settings.use_points and not settings.use_files:
            return "Nothing to output: enable Add Point Cloud or Write Files"
        if settings.use_points and scene.library is not None:
            return "The scene is linked from another file: nothing can be added to it"
        return None

    def _make_job(self, context: bpy.types.Context) -> PointsJob | FilesJob:
        scene, settings = context.scene, context.scene.perfect_bvh.scan
        self._kept: list[tuple[str, PointCloud]] = []
        # The current choice: the panel's may be different when the points are ready.
        self._colors = settings.point_color, settings.point_column
        self._file = ScannedFile(scene, context.view_layer) if settings.use_files else None
        return PointsJob(scene, context.view_layer) if self._file is None else FilesJob(scene, self._file)

    def _hold(self, context: bpy.types.Context) -> float | None:
        from ..live.scene_view import SceneView

        for_viewport = context.scene.perfect_bvh.scan.use_viewport
        return SceneView("scan", context.scene, context.view_layer, for_viewport=for_viewport).hold(self._run)

    def _keep(self) -> None:
        """The points are kept if they are asked for: only a file is missing."""
        self._kept = self._job.result()[0]

    def _finish(self, context: bpy.types.Context) -> set[str]:
        clouds, warnings = self._job.result()
        for warning in warnings:
            self._complain(warning, "WARNING")
        outcomes = self._job.ray_outcomes()
        if outcomes.cast:
            messages.add(context.scene, self.bl_label, str(outcomes), is_note=True)
        if not clouds and self._file is None:
            return {"CANCELLED"}
        made = self._add(context, clouds)
        self._conclude(self._job.summary(made, time.perf_counter() - self._started))
        return {"FINISHED"}

    def _give_up(self, context: bpy.types.Context) -> set[str]:
        if not self._kept:
            return {"CANCELLED"}
        made = self._add(context, self._kept)
        self._complain(f"The points that could not be written are in the scene: {', '.join(made)}", "WARNING")
        return {"FINISHED"}

    def _add(self, context: bpy.types.Context, clouds: list[tuple[str, PointCloud]]) -> list[str]:
        """The names of the objects."""
        made = [_add_object(context, cloud, name, self._colors).name for name, cloud in clouds]
        if made and self._file is not None:
            self._file.points_were_added(context.scene, context.view_layer)
        return made


def _add_object(context: bpy.types.Context, cloud: PointCloud, name: str, colors: tuple[str, str]) -> bpy.types.Object:
    """Adds the points as an object to the active collection, or to the scene's if that is linked.

    It is not selected: its outlines would hide its colours, and the next scan should use the current selection.
    """
    from ..scanning import make_point_object

    made = make_point_object(cloud, name, *colors)
    is_linked = context.collection.library is not None
    (context.scene.collection if is_linked else context.collection).objects.link(made)
    return made


CLASSES = (PERFECT_BVH_OT_scan,)


# Scan jobs -----------------------------------------------------------------------------------------------------------
# The work of the Scan button, in steps: points of all frames at once, or chunks of the frames into files.


class PointsJob:
    """Scans all points, as one object. Raises ValueError if the scan is impossible."""

    def __init__(self, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> None:
        from ..live.scene_view import SceneView
        from ..scanning import Scanner
        from ..scanning.sensor_settings import sensor_of

        settings = scene.perfect_bvh.scan
        check_colors(settings)
        self._view = SceneView("scan", scene, view_layer)
        self._file = None if frames_of(scene, settings) is None else ScannedFile(scene, view_layer)
        self._scanner: Any = Scanner(
            sensor_of(settings),
            settings.sensor,
            frames=frames_of(scene, settings),
            steps_per_frame=settings.steps_per_frame,
            threads=threads_of(scene),
            labels=label_names(settings),
            seed=settings.seed,
            exclude_mount=exclude_mount_of(scene),
            for_viewport=settings.use_viewport,
        )
        self.where = ""
        """The target of the work, for the status bar."""

    @property
    def built_share(self) -> float | None:
        return self._scanner.built_share

    def steps(self) -> Generator[float, None, None]:
        """Yields the share done, 0 to 1."""
        with saved_at_the_users_frame(self._view):
            yield from self._scanner.steps()

    def release(self) -> None:
        """Releases its data at the end, after success or failure."""

    def stopped(self) -> str:
        """Returns the message to a user who has stopped it."""
        return "Scan canceled: nothing was written"

    def result(self) -> tuple[list[tuple[str, PointCloud]], list[str]]:
        """Points to be added, with the names of their objects, and warnings."""
        cloud = self._scanner.result()
        warnings = list(cloud.warnings)
        if self._file is not None and self._file.was_edited:
            warnings.append("The scene was edited during the scan: points of later frames include the edit")
        if not len(cloud):
            return [], [*warnings, "No points were made"]
        return [("Scan", cloud)], warnings

    def ray_outcomes(self) -> RayCounts:
        """The outcomes of the rays."""
        return self._scanner.result().ray_outcomes

    def summary(self, names: list[str], seconds: float) -> str:
        """Returns a sentence about the result. names: of the new objects."""
        cloud = self._scanner.result()
        points, objects = count_of(len(cloud), "point"), count_of(len(cloud.object_names), "object")
        rays = count_of(cloud.ray_count, "ray")
        return f"{names[0]}: {points} on {objects} by {rays}, {duration(1e3 * seconds)}"


class FilesJob(PiecesJob):
    """Chunks of the frames, as files, and on request also as objects, one per chunk.

    Raises ValueError for what cannot be scanned and for a folder of another scan, OSError for one that takes no files.
    """

    def __init__(self, scene: bpy.types.Scene, file: ScannedFile) -> None:
        from ..datasets.drive_work import scan_work

        settings = scene.perfect_bvh.scan
        if settings.use_points:
            check_colors(settings)
        plan, carrier = plan_of(scene), settings.sensor
        plan.scanner(plan.pieces()[0], carrier)  # what cannot be scanned is refused before a folder is made
        folder = folder_of(settings.folder)
        prepare_free_folder(folder)
        self._file = file
        self._keeps = settings.use_points
        self._clouds: list[tuple[str, PointCloud]] = []
        place = plan.folder(folder, file.inputs_of(lambda arguments: plan.inputs(arguments, carrier)))
        super().__init__(scan_work(plan, carrier, place, self._take), folder, settings.use_resume)

    def result(self) -> tuple[list[tuple[str, PointCloud]], list[str]]:
        """Points to be added, with the names of their objects, and warnings."""
        warnings, kept = list(self._outcome.warnings), self._outcome.kept
        if self._keeps and kept:
            existed = count_of(kept, "file")
            warnings.append(f"{existed} existed: these frames were not scanned again. Turn off Resume to scan all")
        return [(name, cloud) for name, cloud in self._clouds if len(cloud)], warnings

    def ray_outcomes(self) -> RayCounts:
        """The outcomes of the rays of the scanned chunks."""
        from ..scanning.piece_scan import ray_counts

        return ray_counts(self._outcome)

    def summary(self, names: list[str], seconds: float) -> str:
        """Returns a sentence about the result. names: of the new objects."""
        written, kept = self._outcome.written, self._outcome.kept
        points = f" with {self._work.summary(self._outcome)[0]}" if written else ""
        existed = f", {count_of(kept, 'file')} existed" if kept else ""
        added = f", added {count_of(len(names), 'object')} to the scene" if self._keeps else ""
        return f"Wrote {count_of(written, 'file')}{points} to {self._folder}{existed}{added}, {duration(1e3 * seconds)}"

    def _take(self, piece: Piece, cloud: PointCloud) -> None:
        self._file.check_unedited(piece.first)
        if self._keeps:
            self._clouds.append((f"Scan {piece.first}-{piece.last}", cloud))
