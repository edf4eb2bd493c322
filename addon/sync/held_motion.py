"""The motions that an engine scene holds beside a record: what of them is new, and the edits for that.

Placing an instance or moving a mesh ends its motion in the engine; so what is edited anyway needs no ending.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt
from perfect_bvh.bulk import are_equal

from . import mesh_edits
from .compare import InstanceDifference, MeshDifference
from .mesh_edits import MeshScene
from .records import BoolArray, InstanceMotions, Int32Array, MeshMotion, SceneMotion, SceneRecord


class MovingScene(MeshScene, Protocol):
    """The part of `perfect_bvh.Scene` that motions need."""

    def set_transforms(self, ids: npt.ArrayLike, transforms: npt.ArrayLike) -> None: ...
    def set_instance_motion(self, ids: npt.ArrayLike, transforms: npt.ArrayLike) -> None: ...


@dataclass(frozen=True, slots=True)
class MotionDifference:
    """What a new record asks for beside its instances and meshes; rows are the new record's.

    ended_instances, ended_meshes: (E,) int32, whose motion ends, and that no other edit ends.
    """

    instances: tuple[InstanceMotions, ...] = ()
    meshes: tuple[MeshMotion, ...] = ()
    ended_instances: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    ended_meshes: tuple[int, ...] = ()
    has_ended: bool = False

    @property
    def is_none(self) -> bool:
        """Whether everything moves as before."""
        return not (self.instances or self.meshes or self.has_ended)

    def apply(self, scene: MovingScene, record: SceneRecord, instance_ids: Int32Array, mesh_ids: Int32Array) -> None:
        """Edits the engine's scene, in which instances and meshes are those of the record already."""
        for row in self.ended_meshes:
            mesh_edits.move(scene, int(mesh_ids[row]), record.meshes[row])
        for mesh in self.meshes:
            mesh_edits.set_motion(scene, int(mesh_ids[mesh.row]), record.meshes[mesh.row], mesh)
        if len(self.ended_instances):
            rows = self.ended_instances
            scene.set_transforms(instance_ids[rows], record.instances.transforms[rows])
        for motions in self.instances:
            scene.set_instance_motion(instance_ids[motions.rows], motions.transforms)


def compare_motion(
    held: SceneRecord | None,
    record: SceneRecord,
    instances: InstanceDifference,
    meshes: Sequence[MeshDifference],
) -> MotionDifference:
    """held: the record before, None if nothing is held. instances, meshes: what else differs."""
    before = SceneMotion() if held is None else held.motion
    after = record.motion
    if not before.count and not after.count:
        return MotionDifference()
    ended, is_any_missing = _ended_instances(before, after, instances)
    mesh_motions, ended_meshes, is_any_gone = _compare_meshes(held, record, meshes)
    return MotionDifference(
        instances=_new_instances(before, after, instances),
        meshes=mesh_motions,
        ended_instances=ended,
        ended_meshes=ended_meshes,
        has_ended=is_any_missing or is_any_gone,
    )


def _ended_instances(
    before: SceneMotion, after: SceneMotion, difference: InstanceDifference
) -> tuple[Int32Array, bool]:
    """Rows of those whose motion is to be ended, and whether any motion ends in whichever way."""
    moved_before = np.zeros(len(difference.removed), np.bool_)
    for motions in before.instances:
        moved_before[motions.rows] = True
    moves = np.zeros(len(difference.held_rows), np.bool_)
    for motions in after.instances:
        moves[motions.rows] = True
    stays = difference.held_rows >= 0
    was_moving = np.zeros(len(stays), np.bool_)
    was_moving[stays] = moved_before[difference.held_rows[stays]]
    ends = was_moving & ~moves
    is_any = bool(ends.any() or (moved_before & difference.removed).any())
    return np.flatnonzero(ends & ~difference.moved).astype(np.int32), is_any


def _new_instances(
    before: SceneMotion, after: SceneMotion, difference: InstanceDifference
) -> tuple[InstanceMotions, ...]:
    """Motions that the engine's instances do not have, or lose by other edits."""
    found = []
    for motions in after.instances:
        is_held = _are_held(motions, before, difference)
        if not is_held.any():
            found.append(motions)
        elif not is_held.all():
            found.append(InstanceMotions(motions.rows[~is_held], motions.transforms[:, ~is_held]))
    return tuple(found)


def _are_held(motions: InstanceMotions, before: SceneMotion, difference: InstanceDifference) -> BoolArray:
    """(K,) bool."""
    held_rows = difference.held_rows[motions.rows]
    found = np.zeros(len(held_rows), np.bool_)
    for old in before.instances:
        if len(old.transforms) != len(motions.transforms):
            continue
        places = np.minimum(np.searchsorted(old.rows, held_rows), len(old.rows) - 1)
        candidates = np.flatnonzero((old.rows[places] == held_rows) & ~difference.moved[motions.rows])
        old_bits = old.transforms[:, places[candidates]].view(np.uint32)
        new_bits = motions.transforms[:, candidates].view(np.uint32)
        found[candidates] = (old_bits == new_bits).all(axis=(0, 2, 3))
    return found


def _compare_meshes(
    held: SceneRecord | None, record: SceneRecord, differences: Sequence[MeshDifference]
) -> tuple[tuple[MeshMotion, ...], tuple[int, ...], bool]:
    """New motions, rows of those that are to be ended, and whether any ends in whichever way."""
    before = {} if held is None else {held.meshes[motion.row].key: motion for motion in held.motion.meshes}
    found, moving = [], set()
    for motion in record.motion.meshes:
        key = record.meshes[motion.row].key
        old = before.get(key)
        moving.add(key)
        if old is None or differences[motion.row].action != "kept" or not _is_same(old, motion):
            found.append(motion)
    ended = [
        row
        for row, (mesh, difference) in enumerate(zip(record.meshes, differences, strict=True))
        if difference.action == "kept" and mesh.key in before and mesh.key not in moving
    ]
    return tuple(found), tuple(ended), any(key not in moving for key in before)


def _is_same(old: MeshMotion, new: MeshMotion) -> bool:
    if old.radii is None or new.radii is None:
        return old.radii is new.radii and are_equal(old.positions, new.positions)
    return are_equal(old.positions, new.positions) and are_equal(old.radii, new.radii)
