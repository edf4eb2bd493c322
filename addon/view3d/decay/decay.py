"""What trees cost from frame to frame of an animation: only refitted, as the governor decides, built anew each time.

Each policy has a scene of the engine of its own. What a tree costs is what the engine says, and what it counts of rays.
Knows no Blender.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import perfect_bvh

from ...support.background_work import BackgroundWork
from ...sync.records import SceneRecord
from ...sync.state import SceneState
from ..sample_rays import RayCost, Rays, cost_of, primary_rays

Progress = Callable[[float], object]

POLICIES = ("refit", "governed", "rebuild")
STEP_SECONDS = 0.05  # of work that takes longer than a step
# What the governor does to trees beyond refitting them, the dearest first.
RESTRUCTURED = ("rebuilt", "partly_rebuilt", "rotated")


@dataclass(frozen=True, slots=True)
class PolicyFrame:
    """One policy in one frame.

    sah: of the trees that rays meet, in sum over the meshes. rays: what rays from outside have met in the mean.
    action: the dearest thing done to any tree, "" where all were kept; reason: the engine's sentence about it.
    milliseconds: of the update.
    """

    sah: float
    rays: RayCost
    action: str
    reason: str
    milliseconds: float


@dataclass(frozen=True, slots=True)
class DecayFrame:
    """policies: by their names."""

    frame: int
    policies: dict[str, PolicyFrame]


@dataclass
class Decay:
    """What was found so far. is_scene: whether of a whole scene, and not of one object."""

    name: str
    scene_uid: int
    is_scene: bool
    frames: Sequence[int]
    rows: list[DecayFrame] = field(default_factory=list)

    def costs(self, policy: str) -> list[float]:
        """Of each frame so far: of an object its tree's SAH, of a scene what a ray meets."""
        found = [row.policies[policy] for row in self.rows]
        if self.is_scene:
            return [one.rays.nodes + one.rays.triangles for one in found]
        return [one.sah for one in found]

    @property
    def measure(self) -> str:
        """What `costs` are: visits are those of nodes and of triangles."""
        return "Visits per ray" if self.is_scene else "SAH"

    def rebuilds(self) -> list[int]:
        """Rows in which the governor built a tree, or parts of one, again; not the first, in which all do."""
        return [
            number for number, row in enumerate(self.rows) if number and row.policies["governed"].action in RESTRUCTURED
        ]


def follow(
    decay: Decay, read: Callable[[int], SceneRecord], expected_rays: int
) -> Generator[tuple[float, int], None, None]:
    """Add a row a frame; yields the share done and the frame, also within one. May be closed at any step.

    read: the records of a frame, called on the thread that goes through the steps.
    Raises ValueError for a first frame without triangles, and what `read` and the engine raise.
    """
    states = {policy: SceneState(partial(_make_scene, policy)) for policy in POLICIES}
    for number, frame in enumerate(decay.frames):
        share = number / len(decay.frames)
        yield share, frame
        record = read(frame)
        if not number and not any(len(mesh.triangles) for mesh in record.meshes):
            raise ValueError(f"{decay.name} has no triangles")
        running = BackgroundWork(partial(_measure, states, record, expected_rays), lambda made: made)
        try:
            while not running.wait(STEP_SECONDS):
                yield share, frame
            decay.rows.append(DecayFrame(frame, running.result()))
        finally:
            running.stop()


def _make_scene(policy: Any) -> perfect_bvh.Scene:
    return perfect_bvh.Scene(policy)


def _measure(
    states: dict[str, SceneState], record: SceneRecord, expected_rays: int, progress: Progress
) -> dict[str, PolicyFrame]:
    found = {}
    for policy, state in states.items():
        report = state.update(record, expected_rays=expected_rays, progress=progress).commit
        scene = state.scene
        assert isinstance(scene, perfect_bvh.Scene)
        snapshot = scene.snapshot()
        costs = [snapshot.tree_sah(int(mesh)) for mesh in state.mesh_ids]
        done = _dearest(report)
        found[policy] = PolicyFrame(
            sah=sum(costs),
            rays=cost_of(snapshot, _rays_at(snapshot)),
            action="" if done is None else done.action,
            reason="" if done is None else done.reason,
            milliseconds=report.milliseconds,
        )
    return found


def _dearest(report: perfect_bvh.CommitReport) -> perfect_bvh.MeshReport | None:
    rank = {action: number for number, action in enumerate(("built", *RESTRUCTURED, "refitted"))}
    done = [mesh for mesh in report.meshes if mesh.action in rank]
    return min(done, key=lambda mesh: rank[mesh.action], default=None)


def _rays_at(snapshot: perfect_bvh.Snapshot) -> Rays:
    """The same for all policies: the box of all that is there does not depend on its trees."""
    boxes = snapshot.tree_boxes(last_level=0).boxes
    lower, upper = boxes[0] if len(boxes) else np.zeros((2, 3))
    return primary_rays(lower, upper)
