"""Places a sensor frame by frame, casts its pattern of rays and collects their hits.

    cloud = perfect_bvh_addon.scan(SpinningLidar(), bpy.data.objects["Empty"], frames=(1, 24))

A frame, or a part of one, is a *stretch*, from one time sample to the next. A sensor that spins goes on in it, and so
does the scene: each ray starts where the sensor is at that ray's own time, and meets what moves where that is then,
between where Blender has both at the stretch's two ends. From stretch to stretch the engine's scene is brought in step
like any other, so that a long scan of a scene in which little moves reads and builds little.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing
from functools import partial
from typing import Any

import bpy
import numpy as np

from ..extract.camera import without_scale
from ..extract.label_values import LabelReader, LabelReading
from ..live.scene_sync import UpdateCommit
from ..live.scene_view import SceneMoment, SceneView, viewport_depsgraph
from ..support.memory import check_fits
from ..sync.not_shown import without_scans
from ..sync.records import AttributeRequest
from .light.model import Light, RayNoise
from .mount import Mount, surrounds
from .outcomes import complaints_of, mount_left_out, unit_complaints
from .patterns import Float64Array, Pattern, View
from .point_cloud import Collector, PointCloud
from .sensor_files import Sensor, sensor_names
from .stretch_sync import StretchSync, TracedStretch
from .stretches import Path, Stretch, Sweep, bend, rays_before, stretches_of
from .things import BoxCollector

Progress = Callable[[float], object]

# Seconds: the divisor for the rays of an interval without length.
MOST_SHORT = 1e-30
# How long a step of a build is, and which share of a stretch a build may come to in the end.
BUILD_STEP_SECONDS = 0.02
BUILD_SHARE = 0.5
# Of the rays of a stretch, and of the points if all of them hit.
BYTES_A_RAY = 360

# A camera looks along -Z with +Y up; anything else along +Y with +Z up, as Blender's front view has it.
FROM_SENSOR_TO_OBJECT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def scan(
    pattern: Pattern | Sensor,
    sensor: bpy.types.Object | None = None,
    *,
    frames: tuple[int, int] | None = None,
    steps_per_frame: int = 1,
    since: int | None = None,
    labels: Sequence[str] = (),
    threads: int = 0,
    progress: Progress | None = None,
    light: Light | None = None,
    seed: int = 0,
    boxes: bool = False,
    exclude_mount: bool | None = None,
    for_viewport: bool = False,
) -> PointCloud:
    """Casts a pattern of rays in the current scene and returns the points that they hit, as a `PointCloud`.

    Surfaces are visible if cameras may see them (Object > Visibility > Ray Visibility). Blender evaluates the scene in
    a render that makes no image; render handlers are called for it. A sensor that is hidden in renders is placed as
    in viewports. Objects whose motion cannot be followed from one time sample to the next, because they appear,
    disappear or get other triangles in between, do not move until the later one, and are listed in
    `PointCloud.warnings`.

    Args:
        pattern: A `CameraGrid`, `SpinningLidar`, `Rosette`, `Raster` or `DepthCamera`, or a whole `Sensor`, see
            `load_sensor`, whose light counts as well.
        sensor: The object that casts them; by default the camera of each frame, as markers choose it. A camera looks
            along its own -Z with +Y up; any other object along +Y with +Z up. A camera grid needs a camera. Scale is
            ignored.
        frames: (first, last), both included; the previous current frame is restored at the end. A LiDAR spins
            through all of them. By default only the current frame, in which a LiDAR makes one whole turn.
        steps_per_frame: The number of time samples of a frame. Blender evaluates each once. Between two of them a
            LiDAR's sensor and all moving objects go in straight lines and turn evenly: each ray starts at the sensor's
            pose at that ray's time, and hits objects at their poses at that time.
            `PointCloud.pose_error` and `scene_error` estimate the error for curved paths. Cycles'
            switches of motion blur do not count. A camera grid is one picture a step, at one time.
        since: The first frame of the whole scan, if these frames are a later part of it: times and ray_ids continue
            from there, so that parts can be joined; object_ids, instance_ids and material_ids are local to a part.
            None, the default: the first of the frames.
        labels: Names of further columns, see `PointCloud.labels`: a custom property (of the hit object, else of
            its instancer, of the object's data, of the instancer's data, of the hit material), or
            "object", "instancer", "material" or "collection" (the first by name that holds the object itself). Texts
            become rows of a sorted table of all texts in the file, so that parts of a scan have the same; numbers
            stay. Points without the label have -1, or NaN among floats: numbers of which one has a fraction or is -1
            itself. Labels have the values at the beginning of an interval.
        threads: The largest number of threads; 0 for all.
        light: The physics of the beams: their width, the kept echoes, glass, mirrors, noise. See
            `Light` and `light/README.md` in this folder. None, the default: the sensor's own. A pattern has none, and
            is an ideal sensor: one thin ray, whose first hit is the point, on any material.
        seed: Of noise and dropout, 0 to 2 ** 31 - 1: the same seed gives the same points, for any threads, parts and
            processes.
        boxes: Whether `PointCloud.boxes` has the 3D boxes of all object instances in the sensor's reach, which takes
            another pass of its rays.
        exclude_mount: Whether the mount is invisible to the rays: the sensor's object and its children, and theirs,
            with the instances that they make; not its parents. None, the default: for a `Sensor` (not for a bare
            pattern) whose object is a mesh around it, that is if the object's origin is inside the bounds of its
            mesh (without modifiers); `PointCloud.warnings` then says so.
        for_viewport: Whether the scan uses the scene of viewports; by default it uses a render's: its objects,
            collections, modifier levels and particles.
        progress: Called with 0 to 1, also while trees are built; returning False raises `perfect_bvh.Cancelled`, within
            about a tenth of a second, as Ctrl-C raises KeyboardInterrupt. The frame is restored in both cases.

    Raises:
        ValueError: For a sensor that cannot scan, or that is deleted during the scan, for a label that nothing in the
            file has or whose values are neither numbers, texts nor data-blocks, and the errors of the engine.
    """
    how = {"frames": frames, "steps_per_frame": steps_per_frame, "since": since, "labels": labels, "threads": threads}
    how |= {"light": light, "seed": seed, "boxes": boxes, "exclude_mount": exclude_mount, "for_viewport": for_viewport}
    scanner = Scanner(pattern, sensor, **how)
    if not scanner.run(progress):
        raise _cancelled()
    return scanner.result()


class Scanner:
    """A scan that can be done in steps, so that Blender continues in between. The arguments are those of `scan`.

    Iterate over `steps()`, or call `run`, which is faster; then call `result()`. Closing the iterator of the
    steps early cancels the scan, also during a build. The current frame is restored in both cases. Each
    interval shows the scene as it was when its first step began.

    Args:
        whole_passes: Whether each frame is one whole sweep of the sensor, such as a turn, in the scene as it is at that
            frame, instead of the part of it that a frame lasts. Times and ray_ids continue from pass to pass.
        before: Called before each interval; the work that it yields in is done before the interval is read.

    Attributes:
        sweeps: The intervals so far, and their points.

    Raises:
        ValueError: For arguments with which no scan is possible.
    """

    def __init__(
        self,
        pattern: Pattern | Sensor,
        sensor: bpy.types.Object | None = None,
        *,
        frames: tuple[int, int] | None = None,
        steps_per_frame: int = 1,
        since: int | None = None,
        labels: Sequence[str] = (),
        threads: int = 0,
        light: Light | None = None,
        seed: int = 0,
        boxes: bool = False,
        exclude_mount: bool | None = None,
        for_viewport: bool = False,
        whole_passes: bool = False,
        before: Callable[[Stretch], Iterator[float]] = lambda _: iter(()),
    ) -> None:
        is_named = isinstance(pattern, Sensor) and pattern.name in sensor_names()
        is_sensor = isinstance(pattern, Sensor)
        if isinstance(pattern, Sensor):
            pattern, light = pattern.pattern, light or pattern.light
        if light is not None and not isinstance(light, Light):
            raise ValueError(f"scan: light must be a Light, such as Light(Beam(rays=7, resolution=0.5)), got {light!r}")
        scene = bpy.context.scene
        if sensor is not None or not any(marker.camera for marker in scene.timeline_markers):
            _check_sensor(pattern, scene.camera if sensor is None else sensor, scene)
        self._pattern = pattern
        self._light, self._random = light, RayNoise(seed)
        self._place = SceneView("scan", scene, bpy.context.view_layer, for_viewport=for_viewport)
        self._sensor = None if sensor is None else (sensor.name, sensor.session_uid)
        rate = scene.render.fps / scene.render.fps_base
        self._stretches = tuple(stretches_of(pattern, rate, frames, steps_per_frame, since, whole_passes))
        self._before, self._boxes = before, BoxCollector() if boxes else None
        self._frame = scene.frame_current_final
        self.sweeps: list[Sweep] = []
        self._threads = threads
        self._labels = LabelReader("scan", labels)
        self._collector = Collector(rays_before(pattern, self._stretches))
        self._warnings: dict[str, None] = {}
        self._exclude_mount = exclude_mount if is_sensor or exclude_mount is not None else False
        self._mount: Mount | None = None
        if is_named:
            self._warnings |= dict.fromkeys(unit_complaints(scene.unit_settings, self._limits[1]))
        self._poses: list[Float64Array] = []
        self._pose_error = self._scene_error = 0.0
        self.built_share: float | None = None
        """The finished share of this interval's trees, 0 to 1, while they are being built."""

    def result(self) -> PointCloud:
        """Returns the points of the finished scan."""
        errors = self._pose_error, self._scene_error
        complaints = complaints_of(self._collector.counts, self._limits)
        boxes = {} if self._boxes is None else self._boxes.columns()
        return self._collector.point_cloud((*self._warnings, *complaints), *errors, self._labels.tables, boxes)

    def run(self, progress: Progress | None = None) -> bool:
        """Does all steps with one evaluated scene, which goes from frame to frame; False once `progress` returns it."""

        def work() -> bool:
            with closing(self.steps()) as steps:
                return all(progress is None or progress(done) is not False for done in steps)

        return self._place.hold(work)

    def steps(self) -> Generator[float, None, None]:
        """Does the scan; yields the share done, 0 to 1, every few tenths of a second, oftener while trees are built.

        To be run through, or closed, on Blender's main thread. Between two steps Blender is where the stretch that they
        are part of ends, and the next one begins; with a camera grid where it begins; and in the current frame, if that
        alone is scanned.
        """
        scene = self._place.find()
        camera_uid = scene.camera.session_uid if scene.camera else 0
        before = scene.frame_current, scene.frame_subframe, camera_uid
        # An interval shows the scene at its reading, even if the user edits it while trees are built and rays are cast:
        # its snapshot must not become stale by that, and the next interval reads the changes.
        sync = StretchSync(AttributeRequest(material_slots=True, shading=self._light is not None))
        try:
            for number, stretch in enumerate(self._stretches):
                for _ in self._before(stretch):
                    yield number / len(self._stretches)
                for done in self._scan_stretch(sync, stretch):
                    yield (number + done) / len(self._stretches)
        finally:
            self.built_share = None
            sync.close()
            if self._stretches[0].frame is not None:
                self._place.set_frame_back(*before)

    def _scan_stretch(self, sync: StretchSync, stretch: Stretch) -> Generator[float, None, None]:
        view, path, building, reading = self._read(sync, stretch)
        labels = reading.of(sync.record)
        # From here on Blender may do anything between two steps, and is asked for nothing any more.
        before_rays = yield from self._build(building)
        snapshot = sync.scene.snapshot()
        yield before_rays  # a scan that was cancelled here casts no rays
        count = self._pattern.count(stretch.start, stretch.end)
        most = 1 if self._light is None else self._light.beam.returns
        check_fits(
            f"scan: an interval of {count:,} rays", count * most * BYTES_A_RAY, "cast fewer, or more steps per frame"
        )
        rays = self._pattern.cast(stretch.start, stretch.end, view)
        shares = (rays.times - stretch.start) / max(stretch.end - stretch.start, MOST_SHORT)
        is_mount = None if self._mount is None else self._mount.find(sync.record)
        cast = TracedStretch(sync, snapshot, self._pattern, rays, path, shares, labels, self._threads, is_mount)
        farthest, first = 0.0, self._collector.point_count
        for traced, distance in cast.collect(self._collector, self._light, self._random):
            farthest = max(farthest, distance)
            left = max(0.0, 1.0 - traced / len(rays))
            yield 1.0 - (1.0 - before_rays) * left  # the last is exactly 1, for any rounding
        self._follow(path, farthest)
        self.sweeps.append(Sweep(stretch, slice(first, self._collector.point_count), path))
        if self._boxes is not None:
            frame = self._frame if stretch.frame is None else stretch.frame + stretch.subframe
            self._boxes.add(frame, stretch.start, cast, self._collector, first)

    def _read(self, sync: StretchSync, stretch: Stretch) -> tuple[View | None, Path, UpdateCommit, LabelReading]:
        """Reads Blender for an interval: the view of a camera grid, the sensor's path, the begun build, labels."""
        return self._place.read(partial(self._read_at, sync, stretch), stretch.frame, stretch.subframe)

    def _read_at(
        self, sync: StretchSync, stretch: Stretch, moment: SceneMoment
    ) -> tuple[View | None, Path, UpdateCommit, LabelReading]:
        """`_read`, where the stretch begins."""
        sensor = self._find_sensor(moment)
        self._find_mount(sensor, sync)
        depsgraph = moment.depsgraph
        count = self._pattern.count(stretch.start, stretch.end)
        view, reading = None, self._labels.read(depsgraph)
        if self._pattern.needs_camera:
            building = sync.begin_update(depsgraph, count, camera=sensor, size=self._pattern.size)
            view, matrix = _view(sync)
            poses = [matrix, matrix]
        else:
            poses = [_pose(sensor, moment)]
            if stretch.is_still:
                building = sync.begin_moment(depsgraph, count)
            else:
                which = sensor.name, sensor.session_uid  # its camera, even if a marker selects another one later
                building = sync.begin_stretch(depsgraph, count, lambda: self._go_on(stretch, moment, which, poses))
        self._warnings |= dict.fromkeys(without_scans(sync.warnings, sync.record.not_shown))
        if self._light is not None:
            left_out = [str(row) for row in sync.record.not_shown if row.kind in ("material", "image")]
            with_finish = [material.name for material in sync.record.materials if material.finish is not None]
            left_out += [f"{name}: scans ignore its sheen, coat, anisotropy and absorption" for name in with_finish]
            self._warnings |= dict.fromkeys(left_out)
        self._scene_error = sync.scene_error
        return view, Path(poses[0], poses[-1]), building, reading

    def _go_on(self, stretch: Stretch, moment: SceneMoment, sensor: tuple[str, int], poses: list[Float64Array]) -> Any:
        """Goes to the interval's end; returns the scene that is evaluated there, and appends the pose to `poses`."""
        moment.go_to(stretch.next_frame, stretch.next_subframe)
        poses.append(_pose(find_sensor(moment.scene, *sensor), moment))
        return moment.depsgraph

    def _follow(self, path: Path, distance: float) -> None:
        """Keeps the last poses, and how far from a straight line they are."""
        self._poses = [*(self._poses or [path.first])[-2:], path.last]
        if len(self._poses) == 3:
            before, here, after = self._poses
            self._pose_error = max(self._pose_error, bend(before, here, after, distance))

    def _build(self, building: UpdateCommit) -> Generator[float, None, float]:
        """Waits for the trees; yields the interval's finished share, and returns it. Raises the engine's errors."""
        share = 0.0
        while not building.wait(BUILD_STEP_SECONDS):
            self.built_share = building.share
            share = BUILD_SHARE * building.share
            yield share
        self.built_share = None
        building.result()
        return share

    @property
    def _limits(self) -> tuple[float, float]:
        """The nearest and the farthest that the sensor measures, in scene units."""
        return getattr(self._pattern, "min_distance", 0.0), getattr(self._pattern, "max_distance", math.inf)

    def _find_mount(self, sensor: bpy.types.Object, sync: StretchSync) -> None:
        """Finds the parts of the sensor's mount, and hides them from the rays if requested or by default."""
        if self._mount is not None and self._mount.uid == sensor.session_uid:
            return
        self._mount = Mount.of(sensor)
        is_default = self._exclude_mount is None and surrounds(sensor)
        sync.hidden = self._mount if self._exclude_mount or is_default else None
        if is_default:
            self._warnings |= {mount_left_out(self._mount.name): None}

    def _find_sensor(self, moment: SceneMoment) -> bpy.types.Object:
        """The one that was named, or the moment's camera."""
        if self._sensor is not None:
            return find_sensor(moment.scene, *self._sensor)
        camera = moment.camera
        _check_sensor(self._pattern, camera, moment.scene)
        return camera


def find_sensor(scene: bpy.types.Scene, name: str, session_uid: int) -> bpy.types.Object:
    """Finds the sensor after an undo, too, which replaces all objects. Raises ValueError if it is gone."""
    found = next((obj for obj in scene.objects if obj.session_uid == session_uid), None)
    if found is None:
        raise ValueError(f"scan: the sensor {name!r} was deleted during the scan")
    return found


def _check_sensor(pattern: Pattern, sensor: bpy.types.Object | None, scene: bpy.types.Scene) -> None:
    if sensor is None:
        raise ValueError(f"scan: scene {scene.name!r} has no active camera: name a sensor")
    if pattern.needs_camera and sensor.type != "CAMERA":
        raise ValueError(f"scan: a camera grid needs a camera as its sensor, got {sensor.name!r}, a {sensor.type}")
    if sensor.name not in scene.objects:
        raise ValueError(f"scan: the sensor {sensor.name!r} is not in scene {scene.name!r}")


def _view(sync: StretchSync) -> tuple[View, Float64Array]:
    """The view of a camera grid, and the (4, 4) matrix from the camera's space to the world."""
    camera = sync.camera
    if camera is None:
        raise ValueError(f"scan: {' '.join(sync.warnings)}")
    return View(camera.window, camera.projection, camera.clip_start, camera.clip_end), camera.matrix


def _pose(sensor: bpy.types.Object, moment: SceneMoment) -> Float64Array:
    """The (4, 4) matrix from the space of a pattern that needs no camera to the world."""
    placed = sensor.evaluated_get(moment.depsgraph)
    if not placed.is_evaluated and moment.frame_set is not None:  # hidden in renders, which do not place it
        scene = moment.scene
        scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)
        placed = sensor.evaluated_get(viewport_depsgraph(moment.depsgraph))
    matrix = without_scale(np.array(placed.matrix_world, dtype=np.float64))
    if matrix is None:
        raise ValueError(f"scan: the sensor {sensor.name!r} has no usable matrix: an axis is scaled to zero")
    if sensor.type != "CAMERA":
        matrix[:3, :3] = matrix[:3, :3] @ FROM_SENSOR_TO_OBJECT
    return matrix


def _cancelled() -> Exception:
    import perfect_bvh

    return perfect_bvh.Cancelled("the scan was cancelled")
