"""The meshes that an engine scene holds: what differs in a new record, the edits for that, and what to expect of each.

A mesh of which nothing is new costs no more than a look: a scene may have ten thousand.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt
from perfect_bvh.bulk import are_equal

from . import mesh_edits
from .compare import UNCHANGED, InstanceDifference, MeshDifference, compare_mesh
from .keys import Int64Array
from .mesh_edits import MeshScene
from .plan import Expectation, UsageTracker
from .records import BoolArray, InstanceMotions, Int32Array, MeshMotion, MeshRecord, SceneMotion, SceneRecord
from .report import MeshChange

if TYPE_CHECKING:
    from perfect_bvh import CommitReport


# Later than any hit: the commit that brought the triangles has not succeeded.
_NEVER = np.iinfo(np.int64).max
# Meshes that are gone of which it is still known what they did.
_MOST_REMEMBERED = 256


@dataclass(slots=True)
class _HeldMesh:
    """A mesh in the engine: its id and usage there, its last record, and the update in which it got its triangles.

    generation: of the scene's commit that brought the triangles; None until it has succeeded. change: of the last
    update. expected_until: the update of the tracker until which the expectation holds if the mesh does not change.
    """

    mesh_id: int
    record: MeshRecord
    usage: str
    generation: int | None = None
    change: MeshChange | None = None
    expected_until: float = 0.0


class HeldMeshes:
    """Meshes by key."""

    def __init__(self) -> None:
        self._meshes: dict[Hashable, _HeldMesh] = {}
        self._last: tuple[MeshRecord, ...] | None = None
        self._ids: Int32Array | None = None  # of the last record's
        self._fresh: list[_HeldMesh] = []  # whose triangles wait for a commit
        self._usages = UsageTracker()

    def __contains__(self, key: Hashable) -> bool:
        return key in self._meshes

    def __iter__(self) -> Iterator[Hashable]:
        return iter(self._meshes)

    def clear(self) -> None:
        """Drops all meshes; their observed changes are remembered."""
        self._meshes.clear()
        self._fresh.clear()
        self._last = self._ids = None

    @property
    def ids(self) -> Int32Array:
        """(M,) int32: the engine's ids of the meshes that were applied last, in their order."""
        if self._ids is None:
            self._ids = np.array([self._meshes[mesh.key].mesh_id for mesh in self._last or ()], np.int32)
        return self._ids

    @property
    def generations(self) -> Int64Array:
        """(M,) int64: the commit since which each of them has its triangles."""
        found = (self._meshes[mesh.key].generation for mesh in self._last or ())
        return np.array([_NEVER if generation is None else generation for generation in found], np.int64)

    def compare(self, meshes: tuple[MeshRecord, ...]) -> tuple[Sequence[MeshDifference], list[Hashable]]:
        """Returns the difference of each mesh, and the keys of removed ones."""
        if meshes is self._last:
            return (UNCHANGED,) * len(meshes), []
        wanted = {mesh.key for mesh in meshes}
        if len(wanted) != len(meshes):
            raise ValueError("update: two meshes of the record have the same key")
        differences = [compare_mesh(self._record_of(mesh.key), mesh) for mesh in meshes]
        return differences, [key for key in self._meshes if key not in wanted]

    def _record_of(self, key: Hashable) -> MeshRecord | None:
        held = self._meshes.get(key)
        return None if held is None else held.record

    def remove(self, scene: MeshScene, key: Hashable) -> MeshChange:
        """Removes a mesh; no instance may show it any more."""
        held = self._meshes.pop(key)
        self._last = self._ids = None
        scene.remove_mesh(held.mesh_id)
        reason = "no object uses it any more"
        return MeshChange(key, held.record.name, held.mesh_id, "removed", reason, held.record.part_count)

    def apply(
        self,
        scene: MeshScene,
        meshes: tuple[MeshRecord, ...],
        differences: Sequence[MeshDifference],
        moved: set[int],
    ) -> list[MeshChange]:
        """Makes the engine's meshes these. moved: rows of those of which an instance moved."""
        now = self._usages.begin_update()
        changes = []
        for row, (mesh, difference) in enumerate(zip(meshes, differences, strict=True)):
            held = self._meshes.get(mesh.key)
            if difference is UNCHANGED and row not in moved and held is not None and now < held.expected_until:
                assert held.change is not None
                changes.append(held.change)
            else:
                changes.append(self._apply(scene, mesh, held, difference, row in moved))
        if meshes is not self._last:
            self._usages.forget_all_but(self._meshes, 2 * len(self._meshes) + _MOST_REMEMBERED)
            self._last, self._ids = meshes, None
        return changes

    def note_commit(self, commit: CommitReport) -> None:
        """The edits have reached the engine's snapshot."""
        for fresh in self._fresh:
            fresh.generation = commit.generation
        self._fresh.clear()

    def _expect(self, mesh: MeshRecord, difference: MeshDifference, has_moved: bool) -> Expectation:
        """Registers the mesh's change, and returns the expectation for it."""
        if difference.action == "replaced":
            self._usages.observe(mesh.key, "changing")
        elif difference.action == "deformed":
            self._usages.observe(mesh.key, "deforming")
        elif difference.action == "kept":
            self._usages.observe(mesh.key, "rigid" if has_moved else "static")
        return self._usages.expect(mesh)

    def _apply(
        self, scene: MeshScene, mesh: MeshRecord, held: _HeldMesh | None, difference: MeshDifference, has_moved: bool
    ) -> MeshChange:
        expected = self._expect(mesh, difference, has_moved)
        usage = "static" if expected.usage == "rigid" else expected.usage  # the engine builds the same tree for both
        if held is not None and held.usage != usage:
            scene.set_usage(held.mesh_id, usage)
            held.usage = usage
        if held is None:
            held = _HeldMesh(mesh_edits.add(scene, mesh, usage=usage), mesh, usage)
            self._meshes[mesh.key] = held
            self._fresh.append(held)
        elif difference.action == "deformed":
            mesh_edits.move(scene, held.mesh_id, mesh)
        elif difference.action == "replaced":
            mesh_edits.replace(scene, held.mesh_id, mesh)
            held.generation = None
            self._fresh.append(held)
        held.record = mesh
        change = MeshChange(
            key=mesh.key,
            name=mesh.name,
            mesh_id=held.mesh_id,
            action=difference.action,
            reason=difference.reason,
            triangle_count=mesh.part_count,
            kind=mesh.kind,
            usage=expected.usage,
            usage_reason=expected.reason,
            remade_by=mesh.remade_by,
        )
        # Only a mesh that stayed the very same record may be reported again in the same words.
        held.change, held.expected_until = change, expected.until if difference is UNCHANGED else 0.0
        return change


# Held motion ---------------------------------------------------------------------------------------------------------
# The motions that an engine scene holds in addition to a record: which of them are new, and their edits.
#
# Placing an instance or moving a mesh ends its motion in the engine, so edited ones need no separate ending.


class MovingScene(MeshScene, Protocol):
    """The part of `perfect_bvh.Scene` that motions need."""

    def set_transforms(self, ids: npt.ArrayLike, transforms: npt.ArrayLike) -> None: ...
    def set_instance_motion(self, ids: npt.ArrayLike, transforms: npt.ArrayLike) -> None: ...


@dataclass(frozen=True, slots=True)
class MotionDifference:
    """The changes of motions in a new record, apart from its instances and meshes; rows are the new record's.

    ended_instances, ended_meshes: (E,) int32, those whose motion ends and that no other edit ends.
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
    """Returns the rows of those whose motion must be ended, and whether any motion ends for any reason."""
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
    """Returns new motions, rows of those that must be ended, and whether any ends for any reason."""
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
