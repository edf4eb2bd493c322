"""Places a sensor frame by frame, casts its pattern of rays and collects what they meet.

    cloud = perfect_bvh_addon.scan(SpinningLidar(), bpy.data.objects["Empty"], frames=(1, 24))

A frame, or a part of one, is a *stretch*, from one key moment to the next. A sensor that spins goes on in it, and so
does the scene: each ray starts where the sensor is at that ray's own time, and meets what moves where that is then,
between where Blender has both at the stretch's two ends. From stretch to stretch the engine's scene is brought in step
like any other, so that a long scan of a scene in which little moves reads and builds little.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
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
from ..sync.records import AttributeRequest
from .light.model import Light, RayNoise
from .mount import Mount, surrounds
from .outcomes import complaints_of, mount_left_out, unit_complaints
from .patterns import Float64Array, Pattern, View
from .point_cloud import Collector, PointCloud
from .sensor_files import Sensor, sensor_names
from .stretch_sync import StretchSync, TracedStretch
from .stretches import Path, Stretch, bend, rays_before, stretches_of

Progress = Callable[[float], object]

# Seconds: what the rays of a stretch of no length are divided by.
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
    exclude_mount: bool | None = None,
    for_viewport: bool = False,
) -> PointCloud:
    """Casts a pattern of rays in the current scene and returns the points that they meet, as a `PointCloud`.

    What is seen is seen as far as cameras may see it (Object > Visibility > Ray Visibility). Blender evaluates it in a
    render that makes no image, of which handlers of renders are told. A sensor that is hidden in renders is placed as
    in viewports. What cannot be followed from one key moment to the next, since it comes, goes or gets other triangles
    in between, stands still until the later one, and is named in `PointCloud.warnings`.

    Args:
        pattern: A `CameraGrid`, `SpinningLidar`, `Rosette`, `Raster` or `DepthCamera`, or a whole `Sensor`, see
            `load_sensor`, whose light counts as well.
        sensor: The object that casts them; by default the camera of each frame, as markers choose it. A camera looks
            along its own -Z with +Y up; any other object along +Y with +Z up. A camera grid needs a camera. Scale is
            ignored.
        frames: (first, last), both included; the frame that was current is set again at the end. A LiDAR spins on
            through all of them. By default the current frame alone, of which a LiDAR makes one whole turn.
        steps_per_frame: How many key moments a frame has. Blender evaluates each once; between two of them the sensor
            of a LiDAR, and all that moves in the scene, goes in straight lines and turns evenly, so that each ray is
            cast from where the sensor is at that ray's time, and meets things where they are then.
            `PointCloud.pose_error` and `scene_error` say how far off that may be where ways are curved. Cycles'
            switches of motion blur do not count. A camera grid is one picture a step, of one moment.
        since: The frame in which the scan began, if these frames are a later part of it: times and ray_ids go on from
            there, so that parts can be put together; object_ids, instance_ids and material_ids are those of a part
            alone. None, the default: the first of the frames.
        labels: Names of further columns, see `PointCloud.labels`: a custom property (of the object that is met, else of
            the instancer that shows it, of the object's data, of the instancer's data, of the material that is met), or
            "object", "instancer", "material" or "collection" (the first by name that holds the object itself). Texts
            become rows of a table of all that the file has, sorted, so that parts of a scan have the same; numbers
            stay. What has no such label has -1, or NaN among floats: numbers of which one has a fraction or is -1
            itself. They are as they are where a stretch begins.
        threads: At most so many; 0 for all.
        light: What light does to the beams: how wide they are, which echoes are kept, glass, mirrors, noise. See
            `Light` and `light/README.md` beside this file. None, the default: the sensor's own; a pattern has none, and
            is an ideal sensor: one thin ray, whose first hit is the point, whatever it is made of.
        seed: Of noise and dropout, 0 to 2 ** 31 - 1: the same one gives the same points, whatever threads, parts and
            processes do the work.
        exclude_mount: Whether the mount is invisible to the rays: the sensor's object and its children, and theirs,
            with the instances that they make; not its parents. None, the default: for a `Sensor` (not for a bare
            pattern) whose object is a mesh around it, that is if the object's origin is inside of the bounds of its
            mesh (without modifiers); `PointCloud.warnings` then says so.
        for_viewport: Whether the scan sees what viewports show; by default what a render does: its objects,
            collections, modifier levels and particles.
        progress: Called with 0 to 1, also while trees are built; returning False raises `perfect_bvh.Cancelled`, within
            about a tenth of a second, as Ctrl-C raises KeyboardInterrupt. The frame is set back either way.

    Raises:
        ValueError: For a sensor that cannot scan, or that is deleted meanwhile, for a label that nothing in the file
            has or whose values are neither numbers, texts nor data-blocks, and what the engine raises.
    """
    how = {"frames": frames, "steps_per_frame": steps_per_frame, "since": since, "labels": labels, "threads": threads}
    how |= {"light": light, "seed": seed, "exclude_mount": exclude_mount, "for_viewport": for_viewport}
    scanner = Scanner(pattern, sensor, **how)
    if not scanner.run(progress):
        raise _cancelled()
    return scanner.result()


class Scanner:
    """A scan that can be done in steps, so that Blender goes on meanwhile. The arguments are those of `scan`.

    Run through `steps()`, or call `run`, which is faster; then ask for the `result()`. Closing the iterator of the
    steps early gives the scan up, in the middle of a build, too; the current frame is set again either way. Each
    stretch shows the scene as it was when its first step began.

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
        exclude_mount: bool | None = None,
        for_viewport: bool = False,
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
        self._stretches = tuple(stretches_of(pattern, rate, frames, steps_per_frame, since))
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
        """How much of the trees of this stretch is built, 0 to 1, as long as they are."""

    def result(self) -> PointCloud:
        """What the finished scan has found."""
        errors = self._pose_error, self._scene_error
        complaints = complaints_of(self._collector.counts, self._limits)
        return self._collector.point_cloud((*self._warnings, *complaints), *errors, self._labels.tables)

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
        # A stretch is about the moments when it was read, whatever the user does while its trees are built and its rays
        # cast: its snapshot must not go stale by that, and the next one reads again what has changed.
        sync = StretchSync(AttributeRequest(material_slots=True, shading=self._light is not None))
        try:
            for number, stretch in enumerate(self._stretches):
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
        yield before_rays  # a scan that was given up meanwhile casts no rays
        count = self._pattern.count(stretch.start, stretch.end)
        most = 1 if self._light is None else self._light.beam.returns
        check_fits(
            f"scan: a stretch of {count:,} rays", count * most * BYTES_A_RAY, "cast fewer, or more steps per frame"
        )
        rays = self._pattern.cast(stretch.start, stretch.end, view)
        shares = (rays.times - stretch.start) / max(stretch.end - stretch.start, MOST_SHORT)
        is_mount = None if self._mount is None else self._mount.find(sync.record)
        cast = TracedStretch(sync, snapshot, self._pattern, rays, path, shares, labels, self._threads, is_mount)
        farthest = 0.0
        for traced, distance in cast.collect(self._collector, self._light, self._random):
            farthest = max(farthest, distance)
            left = max(0.0, 1.0 - traced / len(rays))
            yield 1.0 - (1.0 - before_rays) * left  # the last is 1, whatever is rounded
        self._follow(path, farthest)

    def _read(self, sync: StretchSync, stretch: Stretch) -> tuple[View | None, Path, UpdateCommit, LabelReading]:
        """What a stretch asks of Blender: the view of a camera grid, the sensor's way, trees in the making, labels."""
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
            if stretch.frame is None:
                building = sync.begin_moment(depsgraph, count)
            else:
                which = sensor.name, sensor.session_uid  # its camera, wherever a marker may change to another one
                building = sync.begin_stretch(depsgraph, count, lambda: self._go_on(stretch, moment, which, poses))
        self._warnings |= dict.fromkeys(sync.warnings)
        if self._light is not None:
            left_out = [str(row) for row in sync.record.not_shown if row.kind in ("material", "image")]
            with_finish = [material.name for material in sync.record.materials if material.finish is not None]
            left_out += [f"{name}: scans leave out its sheen, coat, anisotropy and absorption" for name in with_finish]
            self._warnings |= dict.fromkeys(left_out)
        self._scene_error = sync.scene_error
        return view, Path(poses[0], poses[-1]), building, reading

    def _go_on(self, stretch: Stretch, moment: SceneMoment, sensor: tuple[str, int], poses: list[Float64Array]) -> Any:
        """Goes to the stretch's end; gives what is evaluated there, and adds the sensor's pose to `poses`."""
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
        """Waits for the trees; yields the share of the stretch done, and returns it. Raises what the engine raises."""
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
        """Finds what is of the sensor's object, and hides it from the rays if that is asked for, or is the default."""
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
    """By what stays the same when an undo has replaced all objects. Raises ValueError if it is gone."""
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
