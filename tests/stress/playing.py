"""Plays a failure case's states into an engine scene, edit by edit, and judges the hits of rays after each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import perfect_bvh
from makers.zoo import Body, State
from makers.zoo.case import Rays, finite
from oracles.brute_force import Verdict, WorldTriangles, judge
from perfect_bvh.calibration import DEFAULT_FILE, Calibration

# A machine with its own calibration gets the same trees here.
SHIPPED = Calibration.load(DEFAULT_FILE)
ANSWER = ("t_hit", "instance_ids", "primitive_ids", "primitive_uvs")


@dataclass
class _Held:
    mesh_id: int
    part: Body
    instance_ids: np.ndarray


@dataclass(frozen=True)
class Moment:
    """A scene after a commit, and where the state's bodies are in it: instance ids (I,) for each."""

    scene: perfect_bvh.Scene
    state: State
    instance_ids: tuple[np.ndarray, ...]
    report: perfect_bvh.CommitReport

    def world(self) -> WorldTriangles:
        """The oracle's arguments."""
        parts = []
        for part, ids in zip(self.state, self.instance_ids, strict=True):
            for ident, transform in zip(ids.tolist(), part.transforms, strict=True):
                parts.append((ident, part.positions, part.triangles, transform, 0xFFFFFFFF))
        return WorldTriangles.of(parts)


def play(states: tuple[State, ...], build: str | perfect_bvh.BuildConfig = "auto") -> Iterator[Moment]:
    """One scene, edited from state to state: bodies of one name are updated, replaced or moved as they need."""
    scene = perfect_bvh.Scene(calibration=SHIPPED)
    usage = "deforming" if len(states) > 1 else "static"
    held: dict[str, _Held] = {}
    for state in map(finite, states):
        for name in held.keys() - {part.name for part in state}:
            gone = held.pop(name)
            scene.remove_instances(gone.instance_ids)
            scene.remove_mesh(gone.mesh_id)
        for part in state:
            if part.name in held:
                _edit(scene, held[part.name], part)
            else:
                mesh_id = scene.add_mesh(part.positions, part.triangles, build=build, usage=usage)
                held[part.name] = _Held(mesh_id, part, _place(scene, mesh_id, part))
        report = scene.commit()
        yield Moment(scene, state, tuple(held[part.name].instance_ids for part in state), report)


def _edit(scene: perfect_bvh.Scene, held: _Held, part: Body) -> None:
    if not np.array_equal(part.triangles, held.part.triangles) or len(part.positions) != len(held.part.positions):
        scene.replace_mesh(held.mesh_id, part.positions, part.triangles)
    elif not np.array_equal(part.positions, held.part.positions):
        scene.update_mesh(held.mesh_id, part.positions)
    if len(part.transforms) != len(held.part.transforms):
        scene.remove_instances(held.instance_ids)
        held.instance_ids = _place(scene, held.mesh_id, part)
    elif not np.array_equal(part.transforms, held.part.transforms):
        scene.set_transforms(held.instance_ids, part.transforms)
    held.part = part


def _place(scene: perfect_bvh.Scene, mesh_id: int, part: Body) -> np.ndarray:
    return scene.add_instances([mesh_id] * len(part.transforms), part.transforms)


def verdict_on(moment: Moment, rays: Rays, hits: perfect_bvh.Hits) -> Verdict:
    """The double-precision oracle's, written in Python."""
    return judge(moment.world(), *rays, hits.t_hit, hits.instance_ids, hits.primitive_ids)


def bits(hits: perfect_bvh.Hits) -> list[bytes]:
    """The answers, to be compared bit by bit."""
    return [getattr(hits, name).tobytes() for name in ANSWER]


def wrong_answers(
    scene: perfect_bvh.Scene, rays: Rays, t_hit: np.ndarray, instance_ids: np.ndarray, primitive_ids: np.ndarray
) -> np.ndarray:
    """(R,) bool: which answers, of triangles, from any engine, the engine's audit finds wrong."""
    origins, directions = (np.ascontiguousarray(values, np.float64) for values in rays)
    limits = np.zeros(1, np.float32), np.full(1, np.inf, np.float32), np.full(1, 0xFFFFFFFF, np.uint32)
    answers = np.float32(t_hit), np.int32(instance_ids), np.int32(primitive_ids)
    times = np.zeros(1, np.float32)
    audit = scene.snapshot()._committed().audit_answers
    return audit((origins, directions, *limits, times, "none"), *answers, 0, None) & 1 != 0
