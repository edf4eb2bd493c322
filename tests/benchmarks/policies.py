"""Always refit, always rebuild, or governed: the cost of each over an animation, updates and rays together.

    python tests/benchmarks/sync.py --json OUT.json --policies

Each frame is read once and given to all policies in turn, the order rotating; so are the rays. Times are the
processor's, of one thread. Rays are timed in a sample, and the time is scaled to the number of rays passed to the
governor. Each frame counts with the median of the repeats, and the first, on which everything is built, counts too.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
import perfect_bvh
from benchmarks.moving_meshes import MovingMesh, exploding
from benchmarks.rounds import Spread
from perfect_bvh._tuning import with_policy
from perfect_bvh_addon.bench.measurements import rays_from_around
from perfect_bvh_addon.sync.records import InstanceRecords, MeshRecord, ObjectRecord, SceneRecord
from perfect_bvh_addon.sync.state import SceneState

POLICIES = ("refit", "rebuild", "governed")
SAMPLE = 50_000
Floats = npt.NDArray[np.float32]


class TimedScene(perfect_bvh.Scene):
    """Knows how long its last commit took a processor."""

    __slots__ = ("milliseconds",)

    def commit(self, *arguments: Any, **keywords: Any) -> perfect_bvh.CommitReport:
        started = time.thread_time()
        report = super().commit(*arguments, **keywords)
        self.milliseconds = (time.thread_time() - started) * 1e3
        return report


@dataclass(slots=True)
class Run:
    """One policy's frames: milliseconds of each repeat, (repeats, frames); the number of meshes by action."""

    update: list[list[float]] = field(default_factory=list)
    trace: list[list[float]] = field(default_factory=list)
    actions: list[Counter[str]] = field(default_factory=list)  # frame by frame

    def as_json(self) -> dict[str, Any]:
        update, trace = np.array(self.update), np.array(self.trace)
        return {
            "update_ms": float(np.median(update, axis=0).sum()),
            "trace_ms": float(np.median(trace, axis=0).sum()),
            "sum_ms": float(np.median(update + trace, axis=0).sum()),
            "repeats": Spread.of([float(total) for total in (update + trace).sum(axis=1)]).as_json(),
            "actions": dict(sum(self.actions, Counter())),
            "frames": [
                {
                    "update_ms": Spread.of(spent.tolist()).as_json(),
                    "all_ms": Spread.of(both.tolist()).as_json(),
                    "actions": dict(actions),
                }
                for spent, both, actions in zip(update.T, (update + trace).T, self.actions, strict=True)
            ],
        }


def compare(name: str, records: list[SceneRecord], rays: int, repeats: int) -> dict[str, Any]:
    """Plays an animation with each policy; rays: that each frame is said to cast."""
    runs = {policy: Run() for policy in POLICIES}
    batches = [_rays_at(record) for record in records]
    for _ in range(repeats):
        states = {policy: SceneState(lambda policy=policy: with_policy(TimedScene(), policy)) for policy in POLICIES}
        for run in runs.values():
            run.update.append([])
            run.trace.append([])
            run.actions = []
        for number, (record, batch) in enumerate(zip(records, batches, strict=True)):
            for turn in range(len(POLICIES)):
                policy = POLICIES[(turn + number) % len(POLICIES)]
                run, state = runs[policy], states[policy]
                report = state.update(record, expected_rays=rays)
                run.update[-1].append(state.scene.milliseconds)  # type: ignore[attr-defined]
                run.actions.append(Counter(row["action"] for row in report.ledger))
            times = _time_rays({policy: state.scene for policy, state in states.items()}, batch)
            for policy, milliseconds in times.items():
                runs[policy].trace[-1].append(milliseconds * rays / SAMPLE)
    figures = {policy: run.as_json() for policy, run in runs.items()}
    best = min(figures["refit"]["sum_ms"], figures["rebuild"]["sum_ms"])
    return {
        "name": name,
        "frames": [record.frame for record in records],
        "triangles": sum(len(mesh.triangles) for mesh in records[0].meshes),
        "rays": rays,
        "timed_rays": SAMPLE,
        "policies": figures,
        "governed_to_better": figures["governed"]["sum_ms"] / best,
    }


def describe(result: dict[str, Any]) -> str:
    """A line for each policy."""
    lines = [f"{result['name']}: governed / better of the others {result['governed_to_better']:.3f}"]
    for policy, figures in result["policies"].items():
        lines.append(
            f"  {policy:9} update {figures['update_ms']:8.0f} + trace {figures['trace_ms']:8.0f} = "
            f"{figures['sum_ms']:8.0f} ms  {figures['actions']}"
        )
    return "\n".join(lines)


def _time_rays(scenes: dict[str, Any], batch: tuple[Floats, Floats], rounds: int = 2) -> dict[str, float]:
    """The least milliseconds of each."""
    least = dict.fromkeys(scenes, float("inf"))
    for number in range(rounds):
        order = list(scenes)
        for policy in order[number % len(order) :] + order[: number % len(order)]:
            started = time.thread_time()
            scenes[policy].cast_rays(*batch, fields=("t_hit",), threads=1)
            least[policy] = min(least[policy], (time.thread_time() - started) * 1e3)
    return least


def _rays_at(record: SceneRecord) -> tuple[Floats, Floats]:
    """From all around towards random places in the scene's box, as expected rays are modelled."""
    origins, directions = rays_from_around(record, np.random.default_rng(3), SAMPLE)
    return origins.astype(np.float32), directions.astype(np.float32)


def exploding_records(motion: MovingMesh | None = None) -> Iterator[SceneRecord]:
    """A scene of nothing but a bursting ball."""
    motion = motion or exploding()
    count = len(motion.triangles)
    for frame, positions in enumerate(motion.positions):
        mesh = MeshRecord(
            "ball", "ball", positions, motion.triangles, np.arange(count, dtype=np.int32), usage="deforming"
        )
        instances = InstanceRecords(
            mesh_indices=np.zeros(1, np.int32),
            object_indices=np.zeros(1, np.int32),
            parent_indices=np.full(1, -1, np.int32),
            transforms=np.eye(3, 4, dtype=np.float32)[None],
            masks=np.full(1, 0x3F, np.uint32),
            persistent_ids=np.zeros((1, 8), np.int32),
        )
        yield SceneRecord(
            name="exploding",
            frame=float(frame),
            meshes=(mesh,),
            objects=(ObjectRecord("ball", 1, 0),),
            materials=(),
            instances=instances,
            camera=None,
            size=(960, 540),
        )
