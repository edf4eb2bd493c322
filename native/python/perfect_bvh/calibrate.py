"""Measures a `Calibration`: builds, refits and rays on synthetic meshes, a few seconds on one thread.

Each figure is the minimum of several interleaved rounds: other load on the machine only adds time. The costs of
visits are fitted to the times of rays through trees of different quality. The clock is this thread's own CPU time
where the system counts it finely enough.
"""

from __future__ import annotations

import functools
import itertools
import math
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._tuning import Policy, with_policy
from .build_config import BuildConfig, Usage
from .calibration import BUILDERS, BuilderCost, Calibration
from .errors import Cancelled
from .report import MeshReport
from .scene import Scene

Float = npt.NDArray[np.float32]
Progress = Callable[[float], object]
Clock = Callable[[], int]

# Each figure is the minimum of this many rounds; of more with a clock that also counts other programs' time.
ROUNDS, ROUNDS_BY_COMMON_CLOCK = 3, 5
RAYS = 40_000
# A clock with longer steps is too coarse: the shortest measurement takes a millisecond.
COARSE_NANOSECONDS = 100_000
# Initial numbers: the measurements depend only on their ratios.
_UNIT = Calibration(1.0, 1.0, 1.0, 1.0, 1.0, 1.0, {name: BuilderCost(1.0, 1.0) for name in BUILDERS})
_UPDATES: tuple[Policy, ...] = ("refit", "rotate", "rebuild_parts")


@dataclass(frozen=True, slots=True)
class _Mesh:
    positions: Float
    triangles: npt.NDArray[np.int32]


@dataclass(slots=True)
class _Tree:
    """A tree for timing rays. visits: the expected numbers of nodes and of leaves that a ray visits."""

    scene: Scene
    rays: tuple[Float, Float]
    visits: tuple[float, float]
    nanoseconds: float = float("inf")

    def cast(self) -> None:
        clock = _clock()
        started = clock()
        self.scene.cast_rays(*self.rays, fields=("t_hit",), threads=1)
        self.nanoseconds = min(self.nanoseconds, (clock() - started) / RAYS)


@dataclass(slots=True)
class _CommitTimes:
    """Times of all meshes together, in nanoseconds: the minimum so far. in_parts: triangles, the same in each round."""

    builds: dict[str, float] = field(default_factory=lambda: dict.fromkeys(BUILDERS, float("inf")))
    updates: dict[Policy, float] = field(default_factory=lambda: dict.fromkeys(_UPDATES, float("inf")))
    in_parts: dict[Policy, float] = field(default_factory=lambda: dict.fromkeys(_UPDATES, 0.0))

    def take(self, meshes: Sequence[_Mesh]) -> None:
        for name in BUILDERS:
            self.builds[name] = min(self.builds[name], sum(_time_build(mesh, name) for mesh in meshes))
        for policy in _UPDATES:
            updates = [_time_update(mesh, policy) for mesh in meshes]
            self.updates[policy] = min(self.updates[policy], sum(nanoseconds for nanoseconds, _ in updates))
            self.in_parts[policy] = sum(count for _, count in updates)


def calibrate(progress: Progress | None = None) -> Calibration:
    """Measures this machine: a few seconds.

    Args:
        progress: Called with the share done; returning False raises `perfect_bvh.Cancelled`. The process should do
            nothing else during the measurement: the engine works on one thread.
    """
    threads = _core.thread_count()
    _core.set_thread_count(1)
    try:
        return _measure(progress or (lambda _: True))
    finally:
        _core.set_thread_count(threads)


def _measure(progress: Progress) -> Calibration:
    def advance(done: float) -> None:
        if progress(done) is False:
            raise Cancelled("the calibration was cancelled")

    rounds = ROUNDS if _clock() is time.thread_time_ns else ROUNDS_BY_COMMON_CLOCK
    meshes = (_wavy_sphere(), _scattered())
    commits = _CommitTimes()
    for number in range(rounds):
        commits.take(meshes)
        advance(0.6 * (number + 1) / rounds)

    trees = {name: [_built(mesh, name) for mesh in meshes] for name in (*BUILDERS, "median")}
    trees["refitted"] = [_refitted(mesh) for mesh in meshes]
    every = list(itertools.chain.from_iterable(trees.values()))
    for number in range(rounds):
        for tree in every:
            tree.cast()
        advance(0.6 + 0.4 * (number + 1) / rounds)

    triangles = sum(len(mesh.triangles) for mesh in meshes)
    node, leaf = _fit_visits(every)
    builders = {
        name: BuilderCost(
            build_nanoseconds=commits.builds[name] / triangles,
            trace_nanoseconds=math.prod(tree.nanoseconds for tree in trees[name]) ** (1 / len(meshes)),
        )
        for name in BUILDERS
    }
    refit, rotate, rebuild_parts = (commits.updates[policy] / triangles for policy in _UPDATES)
    parts = (rebuild_parts - 2 * refit) * triangles / commits.in_parts["rebuild_parts"]
    return Calibration(
        node_nanoseconds=node,
        leaf_nanoseconds=leaf,
        refit_nanoseconds=refit,
        rotate_nanoseconds=max(rotate - refit, 0.1 * refit),  # the clock's noise must not make rotations free
        rebuild_parts_nanoseconds=max(parts, 0.1 * refit),
        rotation_gain=float(np.mean([_rotation_gain(mesh) for mesh in meshes])),
        builders=builders,
        machine=_machine(),
    )


def choose_clock(own: Clock = time.thread_time_ns, common: Clock = time.perf_counter_ns) -> Clock:
    """Returns `own`, which excludes other programs' work, or `common` if `own` is too coarse. Both count nanoseconds.

    Windows advances a thread's own time 64 times a second, but reports its resolution as 100 ns.
    """
    for _ in range(2):  # a coarse clock may advance by chance during one test, but not during two
        started, before = common(), own()
        while own() == before:
            if common() - started > COARSE_NANOSECONDS:
                return common
    return own


@functools.cache
def _clock() -> Clock:
    return choose_clock()


def _machine() -> str:
    return f"{platform.system()} {platform.machine()} {platform.processor()}".strip() + f", {_core.active_isa()}"


# Meshes of 65,536 triangles -------------------------------------------------------------------------------------------


def _wavy_sphere() -> _Mesh:
    """An evenly tessellated surface."""
    rows, columns = 128, 256
    u, v = np.meshgrid(np.linspace(0, np.pi, rows + 1), np.arange(columns) * (2 * np.pi / columns), indexing="ij")
    radius = 1.0 + 0.15 * np.sin(9 * u) * np.sin(7 * v)
    points = np.stack([radius * np.sin(u) * np.cos(v), radius * np.sin(u) * np.sin(v), radius * np.cos(u)], axis=-1)
    corner = np.arange(rows)[:, None] * columns + np.arange(columns)[None]
    beside = np.arange(rows)[:, None] * columns + (np.arange(columns)[None] + 1) % columns
    lower, upper = (corner, beside, corner + columns), (beside, beside + columns, corner + columns)
    triangles = np.stack([np.stack(lower, axis=-1), np.stack(upper, axis=-1)], axis=2).reshape(-1, 3)
    return _Mesh(points.reshape(-1, 3).astype(np.float32), triangles.astype(np.int32))


def _scattered() -> _Mesh:
    """Leaves and twigs: small and long triangles in clusters, in all orientations."""
    random = np.random.default_rng(1)
    count = 65_536
    middles = random.uniform(-1, 1, (256, 3)).repeat(count // 256, axis=0) + random.normal(0, 0.08, (count, 3))
    along = random.normal(size=(count, 3))
    along *= (np.where(np.arange(count) % 8 == 0, 0.1, 0.015) / np.linalg.norm(along, axis=1))[:, None]
    across = random.normal(0, 0.006, (count, 3))
    positions = np.stack([middles - along, middles + along, middles + across], axis=1).reshape(-1, 3)
    return _Mesh(positions.astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3))


def _bent(mesh: _Mesh) -> Float:
    """Returns positions turned about the axis, by an angle that grows with the height."""
    x, y, z = mesh.positions.T
    angle = 2.0 * z
    cos, sin = np.cos(angle), np.sin(angle)
    return np.column_stack([cos * x - sin * y, sin * x + cos * y, z]).astype(np.float32)


# Measuring -----------------------------------------------------------------------------------------------------------


def _scene_of(mesh: _Mesh, usage: Usage, builder: Any, policy: Policy = "refit") -> tuple[Scene, int]:
    scene = with_policy(Scene(calibration=_UNIT), policy)
    builder = "auto" if builder == "binned" else builder  # builds as the engine does when it has the choice
    number = scene.add_mesh(mesh.positions, mesh.triangles, build=BuildConfig(builder=builder), usage=usage)
    scene.add_instance(number)
    return scene, number


def _time_commit(scene: Scene) -> float:
    clock = _clock()
    started = clock()
    scene.commit()
    return clock() - started


def _time_build(mesh: _Mesh, builder: str) -> float:
    return _time_commit(_scene_of(mesh, "static", builder)[0])


def _time_update(mesh: _Mesh, policy: Policy) -> tuple[float, float]:
    """Times a commit that reuses the memory of the last tree but one, as in an animation.

    Returns its nanoseconds, and the number of triangles in the parts that it rebuilt.
    """
    scene, number = _scene_of(mesh, "deforming", "binned", policy)
    scene.commit()
    clock = _clock()
    for positions in (_bent(mesh), mesh.positions, _bent(mesh)):
        scene.update_mesh(number, positions)
        started = clock()
        report = scene.commit()
        nanoseconds = clock() - started
    return nanoseconds, report.meshes[0].restructured_share * len(mesh.triangles)


def _rotation_gain(mesh: _Mesh) -> float:
    """Returns the gain of rotations as a share of the gain of rebuilding everything above the leaves."""
    rotated, rebuilt = (_update(mesh, policy) for policy in ("rotate", "rebuild_parts"))
    most = rebuilt.refitted_cost - rebuilt.cost
    gain = (rotated.refitted_cost - rotated.cost) / most if most > 0 else 0.0
    return min(max(gain, 0.01), 1.0)


def _update(mesh: _Mesh, policy: Policy) -> MeshReport:
    scene, number = _scene_of(mesh, "deforming", "binned", policy)
    scene.commit()
    scene.update_mesh(number, _bent(mesh))
    return scene.commit().meshes[0]


def _built(mesh: _Mesh, builder: str) -> _Tree:
    return _tree(_scene_of(mesh, "static", builder)[0], mesh.positions)


def _refitted(mesh: _Mesh) -> _Tree:
    scene, number = _scene_of(mesh, "deforming", "binned")
    scene.commit()
    scene.update_mesh(number, _bent(mesh))
    return _tree(scene, _bent(mesh))


def _tree(scene: Scene, positions: Float) -> _Tree:
    row = scene.commit().meshes[0]
    return _Tree(scene, _rays(positions), (row.node_visits, row.leaf_visits))


def _rays(positions: Float) -> tuple[Float, Float]:
    """Makes rays from all around towards random points in the box."""
    random = np.random.default_rng(2)
    lower, upper = positions.min(axis=0), positions.max(axis=0)
    outward = random.normal(size=(RAYS, 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    origins = (lower + upper) / 2 + outward * np.linalg.norm(upper - lower)
    directions = random.uniform(lower, upper, (RAYS, 3)) - origins
    return origins.astype(np.float32), directions.astype(np.float32)


def _fit_visits(trees: list[_Tree]) -> tuple[float, float]:
    """Fits the nanoseconds of a visit to a node and to a leaf, by least squares of relative errors.

    Neither is below a tenth of the mean: a smaller value means that the two occur too often together to be separated.
    """
    visits = np.array([tree.visits for tree in trees])
    times = np.array([tree.nanoseconds for tree in trees])
    rows = np.column_stack([visits, np.ones(len(trees))]) / times[:, None]
    (node, leaf, _), *_ = np.linalg.lstsq(rows, np.ones(len(trees)), rcond=None)
    mean = float(times.sum() / visits.sum())
    if node < 0.1 * mean or leaf < 0.1 * mean:
        return mean, mean
    return float(node), float(leaf)
