"""The edits that a new record needs in an engine's scene, and the report of the result."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .compare import (
    HeldInstances,
    InstanceDifference,
    MeshAction,
    MeshDifference,
    find_look_differences,
    is_same_camera,
    uids_of,
)
from .held import MotionDifference
from .keys import Uint64Array
from .records import Int32Array, ObjectRecord, SceneRecord
from .report import OBJECT_ACTIONS, MeshChange, ObjectColumns, SyncReport

if TYPE_CHECKING:
    from perfect_bvh import CommitReport

# From what happened to instances and meshes to what happened to each object, without a loop over instances.


Int64Array = npt.NDArray[np.int64]

_RANK: dict[str, int] = {action: rank for rank, action in enumerate(OBJECT_ACTIONS)}
_ADDED, _RECOUNTED = _RANK["added"], _RANK["recounted"]


def summarise_objects(
    held: HeldInstances,
    record: SceneRecord,
    difference: InstanceDifference,
    mesh_actions: list[MeshAction],
) -> ObjectColumns:
    """One row an object that has instances, or had.

    mesh_actions: of each of the record's meshes.
    """
    rows = record.instances.object_indices
    new = _Places(record.objects, rows)
    was_same = held.are_those_of(record)
    old = new if was_same else _Places(held.objects, held.columns.object_indices)
    gone = _Places(held.objects, held.columns.object_indices[difference.removed])
    uids = np.union1d(new.uids, gone.uids)

    # Counts each change of each object. An object that existed before is not new, even if its instances are.
    ranks = _instance_ranks(record, difference, mesh_actions)
    counts = new.sum_ranks(uids, rows, ranks)
    was_there = np.isin(uids, old.uids)
    counts[was_there, _RECOUNTED] += counts[was_there, _ADDED]
    counts[was_there, _ADDED] = 0

    instance_counts = counts.sum(axis=1)
    gone_counts = gone.sum(uids) - _Places(record.objects, rows[difference.is_swapped]).sum(uids)
    gone_counts = np.maximum(gone_counts, 0)  # a swapped one was removed only to be added again
    strongest = len(OBJECT_ACTIONS) - 1 - np.argmax(counts[:, ::-1] > 0, axis=1)
    actions = np.maximum(strongest, np.where(gone_counts > 0, _RECOUNTED, 0)).astype(np.int8)
    actions[instance_counts == 0] = _RANK["removed"]

    names = {obj.session_uid: obj.name for obj in (*held.objects, *record.objects)}
    return ObjectColumns(
        names=np.array([names[int(uid)] for uid in uids], dtype=object),
        session_uids=uids,
        actions=actions,
        instance_counts=instance_counts,
        changed_counts=counts[:, 1:].sum(axis=1) + gone_counts,
    )


class _Places:
    """Instances counted by their object's row, to be summed up by its session uid: an object may have several rows."""

    def __init__(self, objects: tuple[ObjectRecord, ...], rows: Int32Array) -> None:
        self._row_uids = np.array(uids_of(objects), np.int64)
        self._counts = np.bincount(rows, minlength=len(objects)).astype(np.int64)
        self.uids: Int64Array = np.unique(self._row_uids[self._counts > 0])

    def sum(self, uids: Int64Array) -> Int64Array:
        """(O,) int64: how many there are of each uid."""
        sums = np.zeros(len(uids), np.int64)
        used = self._counts > 0
        np.add.at(sums, np.searchsorted(uids, self._row_uids[used]), self._counts[used])
        return sums

    def sum_ranks(self, uids: Int64Array, rows: Int32Array, ranks: npt.NDArray[np.int8]) -> Int64Array:
        """(O, actions) int64: how many instances of each uid had each change."""
        width = len(OBJECT_ACTIONS)
        sums = np.zeros((len(uids), width), np.int64)
        if len(ranks) and ranks.min() == ranks.max():  # mostly nothing has happened to any, or the same to all
            sums[:, ranks[0]] = self.sum(uids)
            return sums
        flat = np.bincount(rows.astype(np.int64) * width + ranks, minlength=width * len(self._row_uids))
        used = self._counts > 0
        np.add.at(sums, np.searchsorted(uids, self._row_uids[used]), flat.reshape(-1, width)[used])
        return sums


def _instance_ranks(
    record: SceneRecord, difference: InstanceDifference, mesh_actions: list[MeshAction]
) -> npt.NDArray[np.int8]:
    """(I,) int8: the strongest change of each instance, or of its mesh."""
    instances = record.instances
    masked, moved, is_swapped, added = (
        difference.masked,
        difference.moved,
        difference.is_swapped,
        difference.added,
    )
    ranks: npt.NDArray[np.int8] = moved * np.int8(_RANK["moved"])
    if masked.any():
        ranks[masked & ~moved] = _RANK["masked"]
    if added.any():
        ranks[added] = _ADDED
        ranks[is_swapped] = _RANK["replaced"]
    if len(instances):
        # A mesh that is new is news of an instance only if the instance is new, or shows another mesh than before.
        mesh_ranks = np.array([0 if action == "added" else _RANK[action] for action in mesh_actions], np.int8)
        if mesh_ranks.any():
            ranks = np.maximum(ranks, mesh_ranks[instances.mesh_indices])
    return ranks


# Scene difference ----------------------------------------------------------------------------------------------------


# Of a record, what nothing but words and panels depend on.
PLAIN_FIELDS = ("name", "frame", "warnings", "unseen", "not_shown")


@dataclass(frozen=True, slots=True)
class SceneDifference:
    """The difference between the held scene and a new record.

    held, last: the instances and the record before, the latter None if there was none. meshes: one for each mesh of the
    record. removed_meshes: keys.
    """

    record: SceneRecord
    held: HeldInstances
    last: SceneRecord | None
    keys: Uint64Array
    orders: Int64Array
    meshes: Sequence[MeshDifference]
    removed_meshes: list[Hashable]
    instances: InstanceDifference
    motion: MotionDifference
    milliseconds: float

    @property
    def camera_changed(self) -> bool:
        """Whether the camera, its motion, or the size of the image changed."""
        return self.last is None or not _have_same_camera(self.last, self.record)

    @property
    def materials_changed(self) -> bool:
        """Whether materials changed, or anything else that no ray can detect."""
        return self.last is None or bool(find_look_differences(self.last, self.record))

    @property
    def attributes_changed(self) -> bool:
        """Whether the attributes of any mesh changed."""
        return self.last is None or any(mesh.attributes_changed for mesh in self.meshes)

    @property
    def is_none(self) -> bool:
        """Whether the held scene equals the record."""
        return bool(
            self.last is not None
            and not self.removed_meshes
            and all(mesh.action == "kept" for mesh in self.meshes)
            and self.instances.kept.all()
            and not self.instances.removed.any()
            and self.motion.is_none
            and not self.camera_changed
            and not self.materials_changed
            and not self.attributes_changed
            and all(getattr(self.last, name) == getattr(self.record, name) for name in PLAIN_FIELDS)
            and [mesh.name for mesh in self.last.meshes] == [mesh.name for mesh in self.record.meshes]
        )


@dataclass(frozen=True, slots=True)
class AppliedDifference:
    """A difference that the engine's scene was given as edits, which wait for a commit.

    finishes_earlier_update: whether edits of an earlier one waited, too.
    """

    difference: SceneDifference
    changes: tuple[MeshChange, ...]
    finishes_earlier_update: bool
    milliseconds: float

    def report(self, commit: CommitReport, read_milliseconds: float, commit_milliseconds: float) -> SyncReport:
        """Reports the result."""
        difference = self.difference
        record, instances = difference.record, difference.instances
        return SyncReport(
            frame=record.frame,
            meshes=self.changes,
            object_columns=summarise_objects(
                difference.held, record, instances, [mesh.action for mesh in difference.meshes]
            ),
            added_count=int(instances.added.sum()),
            removed_count=int(instances.removed.sum()),
            moved_count=int(instances.moved.sum()),
            masked_count=int(instances.masked.sum()),
            kept_count=int(instances.kept.sum()),
            motion_count=record.motion.count,
            motion_changed=not difference.motion.is_none,
            camera_changed=difference.camera_changed,
            materials_changed=difference.materials_changed,
            attributes_changed=difference.attributes_changed,
            finishes_earlier_update=self.finishes_earlier_update,
            commit=commit,
            unseen=record.unseen,
            warnings=record.warnings,
            not_shown=record.not_shown,
            read_milliseconds=read_milliseconds,
            compare_milliseconds=difference.milliseconds,
            apply_milliseconds=self.milliseconds,
            commit_milliseconds=commit_milliseconds,
        )


def _have_same_camera(old: SceneRecord, new: SceneRecord) -> bool:
    if old.size != new.size:
        return False
    if old.camera is None or new.camera is None:
        return old.camera is new.camera
    moments = (old.motion.camera, new.motion.camera)
    if len(moments[0]) != len(moments[1]) or not is_same_camera(old.camera, new.camera):
        return False
    return all(is_same_camera(*pair) for pair in zip(*moments, strict=True))
