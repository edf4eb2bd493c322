"""`bake_rays`: casts rays from the surfaces of objects into the whole scene, and gives each face a value."""

from __future__ import annotations

import hashlib
import math
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from dataclasses import dataclass, field, fields, replace
from typing import Any

import bpy
import numpy as np
from perfect_bvh import Cancelled, Scene
from perfect_bvh._checks import check_column, check_count
from perfect_bvh._tuning import Traced

from ..live.scene_sync import SceneSync, UpdateCommit
from ..live.scene_view import SceneMoment, SceneView
from ..support.background_work import BackgroundWork
from ..sync.records import Float64Array, MeshRecord, SceneRecord
from .baked import Bake, BakedObject
from .kinds import SunTally, Tally, Viewer, tally_of
from .receivers import PLACE_SHARE, Receiver, find_receivers, name_flat_faces, place_points
from .settings import NAME, BakeSettings

Progress = Callable[[float], object]

BLOCK_POINTS = 1 << 16  # whose rays are cast at a time: few enough to stop soon, and for the memory
YIELD_SECONDS = 0.05
WAIT_SECONDS = 0.02
BUILD_SHARE = 0.1
_LEAST = frozenset(("nearest_distance", "smallest_angle"))  # a vertex has the least of its corners', not the mean


def bake_rays(
    objects: Iterable[bpy.types.Object] | None = None,
    *,
    kind: str,
    domain: str = "FACE",
    previous: Bake | None = None,
    threads: int = 0,
    for_viewport: bool = False,
    progress: Progress | None = None,
    **choices: Any,
) -> Bake:
    """Casts rays from the surfaces of objects into the whole scene of the context, and gives each element a value.

    Everything in the scene that the kind's rays see is in their way, opaque; only the chosen objects get values. Rays
    leave on the side of the normal (for thickness on the other one), and never hit the triangle on which they begin.
    There is no distance to choose for that: points are off their triangle by a bound of the rounding of double
    precision. Whether a ray is blocked is exact, for the point and the direction as double precision has them. Sampled
    kinds cast two rays in each cell of a grid over the hemisphere. They have the same bytes for any number of threads.
    A surface that lies exactly on another is behind it: under a house the ground is inside, and dark if the walls and
    the roof are within the distance that counts; the house's own floor does not see the ground.

    Args:
        objects: Meshes; None, the default, for the selected ones.
        kind: What is asked: SUN_HOURS, the sum of the weights of the directions of a table from which the point is lit;
            SKY_VIEW, the share of the upper hemisphere of the world that it sees; AMBIENT_OCCLUSION, the share of the
            hemisphere of its normal in which nothing is near; THICKNESS of the solid below it; EXPOSURE, the share of
            viewers that see it, the distance of the nearest one, and the smallest angle to its normal.
        domain: FACE: its centre of area, or the centre of its largest triangle if that is outside the face. CORNER: a
            little inside of it, a 64th of both edges, so that a wall there shadows as it should; FACE keeps that
            distance from the edges of its triangles. POINT: the mean of a vertex's corners. TEXEL: the middles of an
            image's pixels.
        previous: An earlier result with the same settings: objects of which neither the mesh nor the transform nor
            anything in the scene has changed keep their values.
        threads: The largest number of threads; 0 for all.
        for_viewport: Whether the scene of viewports is used; by default that of a render at the current frame.
        progress: Called with 0 to 1; returning False raises `perfect_bvh.Cancelled`.
        directions: SUN_HOURS: a `DirectionTable`; or (D, 3) float64, unit vectors towards the sun in the world, which
            count 1 h each.
        cosine: Whether light is weighted by the cosine to the normal. SUN_HOURS: by default what the table says.
            SKY_VIEW: the view factor (the default), or the share of the solid angle.
        keep_visible: SUN_HOURS on faces: keeps `BakedObject.visible`.
        rays: Of a sampled kind, for each element, at least; 256 by default. Rounded up to a whole grid.
        seed: Of the sampled kinds, 0 to 2 ** 31 - 1.
        distance: How far rays reach, in world units, except to the sun and the sky; infinite by default.
        falloff: AMBIENT_OCCLUSION: a surface at distance t counts (1 - t / distance) ** falloff; 0, the default:
            anything within the distance counts fully.
        method: THICKNESS: "CONE", the mean over a cone of half the opening `angle` (0 to pi / 2, 30 degrees by default)
            of the distances along the normal, weighted by the cosine; or "SPHERE", the diameter of the largest sphere
            inside the solid that touches its surface there. Only the object itself is in the way of these rays.
        viewers: EXPOSURE: an object, whose origin it is (a camera sees its frame only, a curve counts all its points),
            or (V, 3) positions; None, the default, for the scene's camera.
        frames: At which the scene is read: one, or for EXPOSURE any number, whose viewers count together; None, the
            default, for the current one.
        uv_map, image_size: TEXEL: the map by name, by default the active one; (width, height), 1024 each by default.
        instances: Whether instances that others make of the objects get their own values as well.
        evaluated: Whether values are for the elements that modifiers make, for tables. By default an object whose
            modifiers make others than its own mesh has is refused, as its attributes have no place for them.

    Raises:
        ValueError: For settings that make no bake, and for objects that cannot get values: by name. The scene is
            unchanged.
        TypeError: For an argument that `BakeSettings` has not.
    """
    if not (progress is None or callable(progress)):
        raise ValueError(f"{NAME}: progress must be a function of the share done, got {progress!r}")
    baker = Baker(
        objects, BakeSettings(kind, domain, **choices), previous=previous, threads=threads, for_viewport=for_viewport
    )
    if not baker.run(progress):
        raise Cancelled("the bake was cancelled")
    return baker.result()


@dataclass(slots=True)
class _Job:
    """One receiver. tallies: of its blocks, between frames. totals, known: sums of values, and how many."""

    receiver: Receiver
    key: str
    order: Any = None
    tallies: dict[int, Tally] = field(default_factory=dict)
    totals: dict[str, Float64Array] = field(default_factory=dict)
    known: dict[str, Float64Array] = field(default_factory=dict)
    of_faces: dict[str, Any] = field(default_factory=dict)

    def gather(self, tally: Tally) -> None:
        """Adds the values of a block's points to those of their elements."""
        points, count = tally.points, self.receiver.count
        for name, values in tally.columns().items():
            if name in _LEAST:
                np.fmin.at(self.totals.setdefault(name, np.full(count, np.nan)), points.elements, values)
                continue
            is_known = ~np.isnan(values)
            parts = np.where(is_known, values, 0.0) ** (2 if name == "error" else 1)
            for sums, added in ((self.totals, parts), (self.known, is_known)):
                np.add.at(sums.setdefault(name, np.zeros(count)), points.elements, added)
        if tally.settings.domain == "FACE":
            self.of_faces.setdefault("origins", np.full((count, 3), np.nan))[points.elements] = points.positions
        if isinstance(tally, SunTally) and tally.settings.keep_visible:
            visible = self.of_faces.setdefault("visible", np.zeros((count, tally.visible.shape[1]), np.uint8))
            visible[points.elements] = tally.visible

    def result(self, settings: BakeSettings) -> BakedObject:
        """Returns the values of all elements."""
        with np.errstate(invalid="ignore", divide="ignore"):
            columns = {name: np.sqrt(each) if name == "error" else each for name, each in self.totals.items()}
            columns |= {name: columns[name] / known for name, known in self.known.items()}
        error, receiver = columns.pop("error", None), self.receiver
        columns = {name: columns.get(name, np.full(receiver.count, np.nan)) for name in settings.units}
        return BakedObject(
            *(receiver.name, receiver.session_uid, receiver.instance, receiver.instancer, columns, error),
            areas=receiver.areas if settings.domain == "FACE" else None,
            origins=self.of_faces.get("origins"),
            visible=self.of_faces.get("visible"),
            key=self.key,
            positions=receiver.mesh.positions,
            transform=receiver.transform,
        )


class Baker:
    """A bake that can be done in steps, so that Blender continues in between. Arguments: those of `bake_rays`.

    Iterate over `steps()`, or call `run`; then call `result()`, which has the objects that are finished: after a stop
    as well. Objects are looked up again by their session uid, so an undo between two steps does no harm. skip_missing:
    whether objects that the evaluated scene lacks are left out; by default they are refused.

    Raises:
        ValueError: For a choice of objects or viewers with which no bake is possible.
    """

    def __init__(
        self,
        objects: Iterable[bpy.types.Object] | None,
        settings: BakeSettings,
        *,
        previous: Bake | None = None,
        threads: int = 0,
        for_viewport: bool = False,
        skip_missing: bool = False,
    ) -> None:
        scene, layer, viewers = bpy.context.scene, bpy.context.view_layer, settings.viewers
        check_count(NAME, "threads", threads, 0)
        if previous is not None and not isinstance(previous, Bake):
            raise ValueError(f"{NAME}: previous must be a Bake, an earlier result, got {previous!r}")
        if objects is None:
            objects = [obj for obj in layer.objects if obj.select_get()]
        chosen = list(objects) if isinstance(objects, Iterable) else [None]
        if not all(isinstance(obj, bpy.types.Object) for obj in chosen):
            raise ValueError(f"{NAME}: objects must be a sequence of bpy.types.Object, got {objects!r}")
        if not chosen:
            raise ValueError(f"{NAME}: no objects: select the meshes that get values, or pass them")
        self._chosen = [obj.session_uid for obj in chosen]
        self._places = self._viewer = None
        if isinstance(viewers, bpy.types.Object):
            self._viewer = viewers.session_uid
            chosen.append(viewers)
        elif viewers is not None:
            self._places = check_column(NAME, "viewers", viewers, np.float64, (3,))
            if not len(self._places) or not np.isfinite(self._places).all():
                raise ValueError(f"{NAME}: viewers must be an object, or finite positions, got {viewers!r}")
        shown = set(scene.objects)  # names are not enough: a library's object may have that of a local one
        for obj in chosen:
            if obj not in shown:
                raise ValueError(f"{NAME}: object {obj.name!r} is not in scene {scene.name!r}")
        self._needed = {obj.session_uid: obj.name for obj in chosen}
        self.settings, self._threads, self._skip_missing = settings, threads, skip_missing
        self._view = SceneView("bake", scene, layer, for_viewport=for_viewport)
        self._kept = {baked.key: baked for baked in (previous.objects if previous else ()) if baked.key}
        self._sync = SceneSync(watch=False)
        self._done: list[BakedObject] = []
        self._ray_count = 0
        self._warnings: dict[str, None] = {}

    def result(self) -> Bake:
        """Returns the values of the objects that are finished."""
        settings = self.settings
        what = (settings.kind, settings.domain, tuple(self._done), settings.units, self._ray_count)
        return Bake(*what, tuple(settings.image_size), tuple(self._warnings), settings.evaluated)

    def run(self, progress: Progress | None = None) -> bool:
        """Does all steps with one evaluated scene; False once `progress` returns it."""

        def work() -> bool:
            with closing(self.steps()) as steps:
                return all(progress is None or progress(done) is not False for done in steps)

        return self._view.hold(work)

    def steps(self) -> Generator[float, None, None]:
        """Does the bake; yields the share done, 0 to 1, every few hundredths of a second. Closing it stops."""
        scene = self._view.find()
        before = scene.frame_current, scene.frame_subframe, scene.camera.session_uid if scene.camera else 0
        frames = self.settings.frames or (None,)
        jobs: list[_Job] = []
        try:
            for number, frame in enumerate(frames):
                building, receivers, viewers = self._view.read(self._read, frame)
                jobs = jobs or self._begin(receivers)
                _check_same([job.receiver for job in jobs], receivers)
                for job, receiver in zip(jobs, receivers, strict=True):
                    job.receiver = receiver
                for done in self._do(jobs, building, viewers, number == len(frames) - 1):
                    yield (number + done) / len(frames)
        finally:
            self._sync.close()
            if self.settings.frames is not None:
                self._view.set_frame_back(*before)

    def _read(self, moment: SceneMoment) -> tuple[UpdateCommit, list[Receiver], list[Viewer]]:
        """Reads Blender: begins the build, finds the receivers and the viewers."""
        by_uid = {obj.session_uid: obj for obj in moment.scene.objects}
        gone = [name for uid, name in self._needed.items() if uid not in by_uid]
        if gone:
            raise ValueError(f"{NAME}: object {gone[0]!r} was deleted during the bake")
        settings, depsgraph, objects = self.settings, moment.depsgraph, [by_uid[uid] for uid in self._chosen]
        viewer = None if self._viewer is None else by_uid[self._viewer]
        has_camera = settings.kind == "EXPOSURE" and self._places is None and (not viewer or viewer.type == "CAMERA")
        if has_camera and viewer is None and moment.camera is None:
            raise ValueError(f"{NAME}: scene {moment.scene.name!r} has no camera: choose viewers, or add one")
        rays = len(settings.directions.directions) if settings.kind == "SUN_HOURS" else settings.rays
        expected = sum(len(obj.data.polygons) for obj in objects if obj.type == "MESH") * rays
        building = self._sync.begin_update(depsgraph, expected, camera=viewer if has_camera else None)
        receivers = find_receivers(self._sync.record, depsgraph, objects, settings, self._skip_missing)
        self._warnings |= dict.fromkeys((*self._sync.warnings, *filter(None, map(name_flat_faces, receivers))))
        if has_camera:
            camera = self._sync.camera
            if camera is None:
                raise ValueError(f"{NAME}: the camera cannot be used: {' '.join(self._sync.warnings)}")
            return building, receivers, [Viewer(camera.matrix[:3, 3], camera)]
        places = self._places if viewer is None else _places_of(viewer.evaluated_get(depsgraph))
        return building, receivers, [Viewer(place) for place in (() if places is None else places)]

    def _begin(self, receivers: list[Receiver]) -> list[_Job]:
        """Makes the jobs, with what their values depend on; of exposure that is not known."""
        settings = self.settings
        if settings.kind == "EXPOSURE":
            return [_Job(receiver, "") for receiver in receivers]
        scene = () if settings.kind == "THICKNESS" else _arrays_of(self._sync.record)
        table = settings.directions
        light = () if settings.kind != "SUN_HOURS" else (table.directions, table.weights, settings.has_cosine)
        others = (getattr(settings, each.name) for each in fields(BakeSettings) if each.name != "directions")
        common = _digest(*scene, *light, *others)
        keys = [
            _digest(common, one.who, *_shape_of(one.mesh), one.transform, one.uvs, one.corners, one.count)
            for one in receivers
        ]
        return [_Job(one, key) for one, key in zip(receivers, keys, strict=True)]

    def _do(
        self, jobs: list[_Job], building: UpdateCommit, viewers: list[Viewer], is_last: bool
    ) -> Generator[float, None, None]:
        """Casts the rays of all jobs at one frame; in the last one, finishes them."""
        if self.settings.kind == "THICKNESS" or all(job.key in self._kept for job in jobs):
            self._sync.stop_building()
        else:
            while not building.wait(WAIT_SECONDS):
                yield BUILD_SHARE * building.share
            building.result()
        for number, job in enumerate(jobs):
            kept = self._kept.get(job.key)
            if kept is None:
                for done in self._cast(job, viewers, is_last):
                    yield BUILD_SHARE + (1.0 - BUILD_SHARE) * (number + done) / len(jobs)
            if is_last:
                if kept is not None and kept.name != job.receiver.name:
                    kept = replace(kept, name=job.receiver.name)
                self._done.append(kept or job.result(self.settings))
        yield 1.0

    def _cast(self, job: _Job, viewers: list[Viewer], is_last: bool) -> Generator[float, None, None]:
        """Casts the rays of a job at one frame, block by block."""
        settings = self.settings
        scene = yield from self._scene_for(job.receiver)
        points = yield from place_points(job.receiver, settings, job.order)
        job.order = points.ids.astype(np.int64)
        if settings.domain == "POINT" and len(points):  # rays are a vertex's, which has several points
            shared = len(np.unique(points.elements)) / len(points)
            settings = replace(settings, rays=math.ceil(settings.rays * shared))
        blocks = points.blocks(BLOCK_POINTS)
        yielded = time.perf_counter()
        for number, block in enumerate(blocks):
            tally = job.tallies.pop(number, None) or tally_of(settings)(block, settings, viewers)
            # Rays from many surfaces are not alike enough for packets: without them they take a third less time.
            tally.scene, tally.threads = Traced(scene.snapshot(), "stream"), self._threads
            tally.points, tally.viewers, tally.ray_count = block, viewers, 0
            for step in range(tally.step_count):
                tally.cast(step)
                if time.perf_counter() - yielded > YIELD_SECONDS:
                    yield PLACE_SHARE + (1.0 - PLACE_SHARE) * (number + step / tally.step_count) / len(blocks)
                    yielded = time.perf_counter()
            self._ray_count += tally.ray_count
            if is_last:
                job.gather(tally)
            else:
                job.tallies[number] = tally

    def _scene_for(self, receiver: Receiver) -> Generator[float, None, Scene]:
        """Returns the scene that the rays of a receiver may hit: for thickness one of it alone, which is built."""
        if self.settings.kind != "THICKNESS":
            return self._sync.scene
        scene = Scene()
        scene.add_instance(scene.add_mesh(receiver.mesh.positions, receiver.mesh.triangles), receiver.transform)
        building = BackgroundWork(lambda progress: scene.commit(progress=progress), lambda report: report)
        try:
            while not building.wait(WAIT_SECONDS):
                yield 0.0
            building.result()
        finally:
            building.stop()
        return scene


def _check_same(before: list[Receiver], now: list[Receiver]) -> None:
    """Checks that a frame shows what the frames before it showed."""
    if [one.who for one in before] != [one.who for one in now]:
        counts = [Counter(one.name for one in receivers) for receivers in (before, now)]
        name = next(iter((counts[0] - counts[1]) + (counts[1] - counts[0])), before[0].name)
        raise ValueError(f"{NAME}: object {name!r} is not the same in all of the frames: leave it out")


def _places_of(placed: Any) -> Float64Array:
    """(V, 3): the points of an evaluated curve, as finely as Blender draws it; of other objects the origin."""
    matrix = np.array(placed.matrix_world, np.float64)
    if placed.type not in ("CURVE", "CURVES"):
        return matrix[None, :3, 3]
    mesh = placed.to_mesh()
    places = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.vertices.foreach_get("co", places.reshape(-1))
    placed.to_mesh_clear()
    if not len(places):
        raise ValueError(f"{NAME}: the curve {placed.name!r} has no points")
    return np.asarray(places.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3])


def _arrays_of(record: SceneRecord) -> list[Any]:
    """All that rays may hit."""
    instances = record.instances
    meshes = [array for mesh in record.meshes for array in _shape_of(mesh)]
    return [instances.mesh_indices, instances.transforms, instances.masks, *meshes]


def _shape_of(mesh: MeshRecord) -> list[Any]:
    return [mesh.positions, mesh.triangles, mesh.polygon_ids, mesh.radii, mesh.curve_offsets, mesh.form]


def _digest(*values: Any) -> str:
    digest = hashlib.blake2b(digest_size=16)
    for value in values:
        is_array = isinstance(value, np.ndarray)
        digest.update(repr((value.shape, value.dtype) if is_array else value).encode())
        digest.update(np.ascontiguousarray(value).data if is_array else b",")
    return digest.hexdigest()
