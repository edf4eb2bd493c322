"""The Scan button: casts the rays that the panel describes and makes a point cloud of what they meet.

In a window it works in steps of a timer while Blender goes on, builds trees beside it, and Esc gives it up at any time;
nothing is made before the end.
Without one, or when a script calls it, it does the same in one go.
"""

from __future__ import annotations

import time
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import bpy
import numpy as np

from ..settings.preferences import native_error
from ..statistics.words import duration
from ..support.files import check_writable
from .ticking import Ticking

if TYPE_CHECKING:
    from ..scanning import Pattern, PointCloud

STEP_SECONDS = 0.1
NAME = "Scan"
MOST_LINES = 4096  # of a LiDAR: so many that a digit too much costs no minutes and no memory


class PERFECT_BVH_OT_scan(Ticking, bpy.types.Operator):
    """Steps through a scan in a timer."""

    bl_idname = "perfect_bvh.scan"
    bl_label = "Scan"
    bl_description = "Cast rays from the sensor and make a point cloud of what they meet"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    # Blender evaluates these annotations, and the scanner's module needs the native engine.
    _scanner: Any
    _steps: Generator[float, None, None]
    _started: float

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        complaint = native_error() or _find_complaint(context)
        if complaint is not None:
            cls.poll_message_set(complaint)
        return complaint is None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self._begin(context):
            return {"CANCELLED"}
        self._begin_ticking(context)
        self._show_state(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC":
            self._end(context)
            self.report({"INFO"}, "The scan was stopped: nothing was made")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        done = self._step(STEP_SECONDS)
        if done is None:
            self._end(context)
            return {"CANCELLED"}
        context.window_manager.progress_update(100 * done)
        self._show_state(context)
        if done < 1.0:
            return {"RUNNING_MODAL"}
        self._end(context)
        return self._finish(context)

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends or opens another file."""
        self._end(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self._begin(context):
            return {"CANCELLED"}
        done: float | None = 0.0
        while done is not None and done < 1.0:
            done = self._step(STEP_SECONDS)
        return {"CANCELLED"} if done is None else self._finish(context)

    # The parts -------------------------------------------------------------------------------------------------------

    def _begin(self, context: bpy.types.Context) -> bool:
        from ..scanning import Scanner

        scene = context.scene
        settings = scene.perfect_bvh.scan
        frames = (scene.frame_start, scene.frame_end) if settings.use_frame_range else None
        self._forget_complaints()
        self._started = time.perf_counter()
        try:
            path = _path_of(settings)
            if path is not None:
                check_writable(path)
            self._scanner = Scanner(
                pattern_of(settings),
                settings.sensor,
                frames=frames,
                steps_per_frame=settings.steps_per_frame,
                labels=[name.strip() for name in settings.labels.split(",") if name.strip()],
                threads=scene.render.threads if scene.render.threads_mode == "FIXED" else 0,
            )
        except (ValueError, OSError) as problem:
            self._complain(problem)
            return False
        self._steps = self._scanner.steps()
        return True

    def _step(self, seconds: float) -> float | None:
        """Work for about `seconds`; the share done, None if the scan has failed, with the reason reported."""
        import perfect_bvh

        deadline = time.perf_counter() + seconds
        try:
            for done in self._steps:
                # While trees are built there is nothing to do but let Blender go on.
                if time.perf_counter() >= deadline or self._scanner.built_share is not None:
                    # The last step is over when the iterator is: it sets the frame back.
                    return min(done, 0.999)
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            self._complain(problem)
            return None
        return 1.0

    def _show_state(self, context: bpy.types.Context) -> None:
        built = self._scanner.built_share
        state = "Scanning" if built is None else f"Building trees {built:.0%}"
        self._tell(context, f"{state}: Esc stops it")

    def _end(self, context: bpy.types.Context) -> None:
        self._steps.close()
        self._end_ticking(context)

    def _finish(self, context: bpy.types.Context) -> set[str]:
        cloud = self._scanner.result()
        for warning in cloud.warnings:
            self._complain(warning, "WARNING")
        if not len(cloud):
            self._complain(f"None of {cloud.ray_count:,} rays met anything: no points were made", "WARNING")
            return {"CANCELLED"}
        made = _add_object(context, cloud)
        seconds = time.perf_counter() - self._started
        found = f"{made.name}: {len(cloud):,} points on {len(cloud.object_names):,} objects, {cloud.ray_count:,} rays"
        path = _path_of(context.scene.perfect_bvh.scan)
        try:
            where = "" if path is None else f", written to {cloud.save(path)}"
        except OSError as problem:
            # The points are kept: only the file is missing.
            self._complain(f"{found}, but {problem.strerror or problem}")
            return {"FINISHED"}
        self.report({"INFO"}, f"{found}, {duration(1e3 * seconds)}{where}")
        return {"FINISHED"}


def pattern_of(settings: bpy.types.PropertyGroup) -> Pattern:
    """The rays that the panel describes. Raises ValueError for elevations that cannot be read."""
    from ..scanning import CameraGrid, SpinningLidar

    if settings.pattern == "CAMERA":
        return CameraGrid(settings.width, settings.height)
    return SpinningLidar(
        elevations=parse_elevations(settings.elevations),
        columns=settings.columns,
        rate=settings.rate,
        max_distance=settings.max_distance,
    )


def parse_elevations(text: str) -> tuple[float, ...]:
    """Degrees from "-30.67, -29.33, ..." or from "lowest:highest:count". Raises ValueError if it is neither."""
    try:
        if ":" in text:
            lowest, highest, count = text.split(":")
            if int(count) > MOST_LINES:
                raise ValueError(f"{count} lines")
            return tuple(float(angle) for angle in np.linspace(float(lowest), float(highest), int(count)))
        return tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError as problem:
        raise ValueError(
            f"Elevations must be degrees with commas between, or lowest:highest:count with a count of at most "
            f"{MOST_LINES:,}, got {text!r}"
        ) from problem


def _find_complaint(context: bpy.types.Context) -> str | None:
    """Why no scan is possible here."""
    scene = context.scene
    if context.mode != "OBJECT":
        return "Points are added as an object: leave the mode of the active one first"
    if scene.perfect_bvh.scan.sensor is None and scene.camera is None:
        return "There is neither a sensor nor an active camera"
    if scene.library is not None:
        return "The scene is linked from another file: nothing can be added to it"
    return None


def _path_of(settings: bpy.types.PropertyGroup) -> Path | None:
    if not settings.filepath.strip():
        return None
    if settings.filepath.startswith("//") and not bpy.data.filepath:
        raise ValueError(f"{settings.filepath!r} is relative to the .blend file: save that first")
    path = Path(bpy.path.abspath(settings.filepath))
    if path.is_dir():
        raise ValueError(f"{path} is a folder: name a file in it")
    return path if path.suffix == ".npz" else path.with_name(path.name + ".npz")


def _add_object(context: bpy.types.Context, cloud: PointCloud) -> bpy.types.Object:
    """The points as an object in the active collection, or the scene's if that is linked.

    Not selected: its outlines would hide its colours, and the next scan shall find what is selected and active now.
    """
    from ..scanning import make_point_object

    made = make_point_object(cloud, NAME, context.scene.perfect_bvh.scan.point_color)
    is_linked = context.collection.library is not None
    (context.scene.collection if is_linked else context.collection).objects.link(made)
    return made


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_OT_scan)


def unregister() -> None:
    bpy.utils.unregister_class(PERFECT_BVH_OT_scan)
