"""Measurements: a scene's records, the rays that its camera would cast, and each build of its trees."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import numpy.typing as npt
import perfect_bvh
from perfect_bvh import BuildConfig
from perfect_bvh._tuning import with_policy

from ..extract import ReadCache, read_scene
from ..scanning.patterns import CameraGrid, View
from ..support.background_work import BackgroundWork
from ..sync import mesh_edits
from ..sync.records import CameraRecord, SceneRecord
from ..sync.report import SyncReport
from ..sync.state import SceneState
from .advice import LABELS

if TYPE_CHECKING:
    import bpy

# The subject: a scene as plain records, the rays that its camera would cast, and its frames.


Float64Array = npt.NDArray[np.float64]
PIXELS = (400, 225)  # of the picture whose rays are cast


@dataclass(frozen=True, slots=True)
class Subject:
    """record: the frame to measure. frames: of the animation; read: reads one of them, at which Blender then stays."""

    name: str
    record: SceneRecord
    frames: Sequence[int] = ()
    read: Callable[[int], SceneRecord] | None = None

    @property
    def triangle_count(self) -> int:
        """The triangles of the distinct meshes."""
        return sum(len(mesh.triangles) for mesh in self.record.meshes)


def make_scene(record: SceneRecord, config: BuildConfig | None = None) -> perfect_bvh.Scene:
    """Adds all meshes and instances, without a commit. config: of every mesh; None: the planner's choice."""
    scene = perfect_bvh.Scene()
    build: Any = "auto" if config is None else config
    meshes = np.array([mesh_edits.add(scene, mesh, build=build) for mesh in record.meshes], np.int32)
    instances = record.instances
    scene.add_instances(meshes[instances.mesh_indices], instances.transforms)
    return scene


def bounced_rays(record: SceneRecord, scene: perfect_bvh.Scene) -> tuple[Float64Array, Float64Array]:
    """Returns origins and directions (R, 3): from the camera's hits in random directions, as light bounces.

    Without a camera, or if it sees nothing: from all around towards random points of the scene.
    """
    random = np.random.default_rng(5)
    if record.camera is not None:
        origins, directions, t_min, t_max = _camera_rays(record.camera)
        fields = ("t_hit", "positions", "geometric_normals")
        hits = scene.cast_rays(origins, directions, t_min=t_min, t_max=t_max, fields=fields)
        rows = np.isfinite(hits.t_hit)
        if rows.any():
            normals = hits.geometric_normals[rows].astype(np.float64)
            normals *= np.where(np.einsum("ij,ij->i", normals, directions[rows]) > 0.0, -1.0, 1.0)[:, None]
            starts = hits.positions[rows].astype(np.float64)
            reach = float(np.abs(starts).max() + hits.t_hit[rows].max())
            bounced = _unit(random.normal(size=normals.shape)) + 1.0001 * normals
            return starts + 1e-5 * reach * normals, _unit(bounced)
    return rays_from_around(record, random, PIXELS[0] * PIXELS[1])


def _camera_rays(camera: CameraRecord) -> tuple[Float64Array, Float64Array, float, float]:
    view = View(camera.window, camera.projection, camera.clip_start, camera.clip_end)
    rays = CameraGrid(*PIXELS).cast(0.0, 1.0, view)
    matrix = np.asarray(camera.matrix, np.float64)
    directions = rays.directions @ matrix[:3, :3].T
    return rays.origins @ matrix[:3, :3].T + matrix[:3, 3], directions, rays.t_min, rays.t_max


def rays_from_around(record: SceneRecord, random: np.random.Generator, count: int) -> tuple[Float64Array, Float64Array]:
    """Origins and directions (count, 3): from all around towards random places in the scene's box."""
    transforms = record.instances.transforms.astype(np.float64)
    lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
    for row, transform in zip(record.instances.mesh_indices, transforms, strict=True):
        positions = record.meshes[row].positions
        corners = np.stack([positions.min(axis=0), positions.max(axis=0)]).astype(np.float64)
        middle = transform[:, :3] @ corners.mean(axis=0) + transform[:, 3]
        half = np.abs(transform[:, :3]) @ (np.ptp(corners, axis=0) / 2)
        lower, upper = np.minimum(lower, middle - half), np.maximum(upper, middle + half)
    origins = (lower + upper) / 2 + _unit(random.normal(size=(count, 3))) * np.linalg.norm(upper - lower)
    return origins, random.uniform(lower, upper, (count, 3)) - origins


def _unit(vectors: Float64Array) -> Float64Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


# From blender --------------------------------------------------------------------------------------------------------
# The scene that Blender shows, as the subject of a measurement.


def subject_of(scene: bpy.types.Scene, *, for_viewport: bool = False) -> Subject:
    """The current frame, as renders see it, or with `for_viewport` as viewports do; others are read when asked for.

    Then the scene may be gone: that is a ValueError.
    """
    import bpy

    from ..live.scene_view import SceneView

    cache = ReadCache()
    layer = bpy.context.view_layer if scene == bpy.context.scene else scene.view_layers[0]
    view = SceneView("bench", scene, layer, for_viewport=for_viewport)

    def read(frame: int) -> SceneRecord:
        return view.read(lambda moment: read_scene(moment.depsgraph, cache=cache), frame)

    record = view.read(lambda moment: read_scene(moment.depsgraph))
    return Subject(scene.name, record, range(scene.frame_start, scene.frame_end + 1, scene.frame_step), read)


# Measurements --------------------------------------------------------------------------------------------------------
# Measurements of a user's scene, step by step, each part within its share of the time; existing results are kept.


Figures = dict[str, Any]
Step = tuple[float, str]  # the share of the time that is over, and what comes next
Made = TypeVar("Made")
Progress = Callable[[float], bool]

BUILDERS = ("fast", "auto", "sweep", "spatial")
LARGE = 5_000_000  # triangles above which the slow builders are left out
POLICIES = ("refit", "rebuild", "governed")
RAY_COUNTS = tuple(10**power for power in range(4, 11))
MOST_ROUNDS, MOST_FRAMES = 7, 48
# Of all the time, until when each part may start something new.
PARTS = {"builders": 0.5, "answers": 0.65, "planner": 0.75, "frames": 0.97}
STEP_SECONDS = 0.05  # of work that takes longer than a step
NANOSECONDS_PER_CHECK = 8.0  # of a ray with a triangle in an audit, with room to spare


class SceneBench:
    """figures: the measurements so far, ready for JSON."""

    def __init__(self, subject: Subject, seconds: float = 60.0, clock: Callable[[], float] = time.perf_counter) -> None:
        self._subject, self._seconds, self._clock = subject, seconds, clock
        self._started = clock()
        self.figures: Figures = {
            "machine": describe_machine(),
            "scene": subject.name,
            "frame": subject.record.frame,
            "meshes": len(subject.record.meshes),
            "instances": len(subject.record.instances),
            "triangles": subject.triangle_count,
        }

    def steps(self) -> Generator[Step, None, None]:
        """Measure; may be closed at any step, in the middle of a build too. Raises ValueError without triangles."""
        if not self._subject.triangle_count:
            raise ValueError(f"bench: scene {self._subject.name!r} has no triangles")
        yield 0.0, "rays"
        first = make_scene(self._subject.record)
        yield from self._commit(first, "rays")
        self._rays = bounced_rays(self._subject.record, first)
        self.figures["rays"] = len(self._rays[0])
        yield from self._builders()
        yield from self._answers(first)
        yield from self._planner()
        yield from self._frames()

    # Parts ----------------------------------------------------------------------------------------------------------

    def _builders(self) -> Generator[Step, None, None]:
        names = BUILDERS if self._subject.triangle_count <= LARGE else BUILDERS[:2]
        rows = {name: _Row() for name in names}
        for round_number in range(MOST_ROUNDS):
            for name in names:
                if round_number and self._is_over("builders"):
                    return
                yield self._share(), f"builder {LABELS[name]}"
                scene = make_scene(self._subject.record, BuildConfig(builder=name))  # type: ignore[arg-type]
                milliseconds = yield from self._commit(scene, f"builder {LABELS[name]}")
                rows[name].build.append(milliseconds)
                rows[name].trace += [self._cast(scene) for _ in range(2)]
                rows[name].byte_count = scene.statistics().byte_count
                self.figures["builders"] = [{"name": key, **row.as_json()} for key, row in rows.items() if row.build]

    def _answers(self, scene: perfect_bvh.Scene) -> Generator[Step, None, None]:
        """How many answers of a random share are wrong."""
        records = self._subject.record
        sizes = np.array([mesh.part_count for mesh in records.meshes])
        triangles = int(sizes[records.instances.mesh_indices].sum())
        budget = 1e9 * max(0.1, PARTS["answers"] * self._seconds - self._passed()) / 3.0
        threads = perfect_bvh.thread_count()
        share = min(1.0, budget * threads / (NANOSECONDS_PER_CHECK * triangles * len(self._rays[0])))
        yield self._share(), "rays"
        row = _Row(trace=[self._cast(scene) for _ in range(5)])
        yield self._share(), "check of results"
        audit = yield from self._aside(partial(self._audit, scene, share), "check of results")
        self.figures["answers"] = {
            **row.as_json(),
            "checked": audit.checked_count,
            "not_judged": audit.not_judged_count,
            "wrong": len(audit.wrong_rows),
            "wrong_per_million": audit.wrong_per_million,
            "interval": list(audit.interval),
        }

    def _planner(self) -> Generator[Step, None, None]:
        """Measures the builders that each number of expected rays leads to: triangles by builder."""
        for rays in RAY_COUNTS:
            if self._is_over("planner"):
                return
            yield self._share(), "choice of builders"
            scene = make_scene(self._subject.record)
            report = yield from self._aside(partial(_commit, scene, rays), "choice of builders")
            counts: dict[str, int] = {}
            for mesh in report.meshes:
                counts[mesh.builder] = counts.get(mesh.builder, 0) + mesh.triangle_count
            self.figures.setdefault("planner", []).append({"rays": rays, "triangles": counts})

    def _frames(self) -> Generator[Step, None, None]:
        """Measures each policy over the animation: updates and a million rays after each; a ray's visits."""
        if self._subject.read is None or len(self._subject.frames) < 2:
            return
        states = {
            policy: SceneState(lambda policy=policy: with_policy(perfect_bvh.Scene(), policy)) for policy in POLICIES
        }
        rows: list[Figures] = []
        for number in self._subject.frames[:MOST_FRAMES]:
            if self._is_over("frames"):
                break
            yield self._share(), f"frame {number}"
            record = self._subject.read(number)
            row: Figures = {"frame": number, "rays": 1_000_000, "policies": {}}
            for policy, state in states.items():
                update = partial(_update, state, record, row["rays"])
                report = yield from self._aside(update, f"frame {number}")
                cast = min(self._cast(state.scene) for _ in range(2))  # type: ignore[arg-type]
                row["policies"][policy] = {
                    "update_ms": report.commit.milliseconds,
                    "trace_ms": cast * row["rays"] / len(self._rays[0]),
                    "visits": self._visits(state.scene),  # type: ignore[arg-type]
                    "actions": sorted({mesh.action for mesh in report.commit.meshes}),
                    "moved": report.moved_count,
                }
            rows.append(row)
            self.figures["frames"] = rows

    # Long work ------------------------------------------------------------------------------------------------------

    def _commit(self, scene: perfect_bvh.Scene, what: str) -> Generator[Step, None, float]:
        """Commits, and returns its milliseconds."""
        return self._aside(lambda progress: self._timed(lambda: scene.commit(progress=progress)), what)

    def _audit(self, scene: perfect_bvh.Scene, share: float, progress: Progress) -> Any:
        return scene.cast_rays(*self._rays, audit=share, progress=progress).audit

    def _aside(self, work: Callable[[Progress], Made], what: str) -> Generator[Step, None, Made]:
        """Returns the result of the work; yields steps during it, and closing their iterator stops it."""
        running = BackgroundWork(work, lambda made: made)
        try:
            while not running.wait(STEP_SECONDS):
                yield self._share(), what
            return running.result()
        finally:
            running.stop()

    # Time -----------------------------------------------------------------------------------------------------------

    def _cast(self, scene: perfect_bvh.Scene) -> float:
        """Milliseconds of all the rays on all threads."""
        return self._timed(lambda: scene.cast_rays(*self._rays, fields=("t_hit",)))

    def _timed(self, work: Callable[[], object]) -> float:
        started = self._clock()
        work()
        return (self._clock() - started) * 1e3

    def _visits(self, scene: perfect_bvh.Scene) -> float:
        """Nodes and primitives that a ray visits in the mean: what trees cost, however busy the machine is."""
        hits = scene.cast_rays(*self._rays, fields=("nodes_visited", "primitives_tested"))
        return float(hits.nodes_visited.mean() + hits.primitives_tested.mean())

    def _passed(self) -> float:
        return self._clock() - self._started

    def _is_over(self, part: str) -> bool:
        return self._passed() >= PARTS[part] * self._seconds

    def _share(self) -> float:
        return min(self._passed() / self._seconds, 0.99)


def _commit(scene: perfect_bvh.Scene, rays: int, progress: Progress) -> perfect_bvh.CommitReport:
    return scene.commit(expected_rays=rays, progress=progress)


def _update(state: SceneState, record: SceneRecord, rays: int, progress: Progress) -> SyncReport:
    return state.update(record, expected_rays=rays, progress=progress)


class _Row:
    """Milliseconds of builds and of casts."""

    def __init__(self, trace: list[float] | None = None) -> None:
        self.build: list[float] = []
        self.trace: list[float] = trace or []
        self.byte_count = 0

    def as_json(self) -> Figures:
        found: Figures = {"trace_ms": _spread(self.trace)}
        if self.build:
            found |= {"build_ms": _spread(self.build), "byte_count": self.byte_count}
        return found


def _spread(values: list[float]) -> Figures:
    """Sums up values. typical: the lower third, since other load on the machine only adds time; and the quartiles."""
    low, typical, high = np.quantile(values, [0.25, 1.0 / 3.0, 0.75], method="nearest")
    return {"typical": float(typical), "low": float(low), "high": float(high), "count": len(values)}


def describe_machine() -> Figures:
    """Describes the conditions of the figures other than the scene."""
    return {
        "processor": platform.processor() or platform.machine(),
        "threads": perfect_bvh.thread_count(),
        "isa": perfect_bvh.active_isa(),
        "perfect_bvh": perfect_bvh.__version__,
    }
