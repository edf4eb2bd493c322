"""From what happened to instances and meshes to what happened to each object, without a loop over instances."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .compare import HeldInstances, InstanceDifference, MeshAction, uids_of
from .records import Int32Array, ObjectRecord, SceneRecord
from .report import OBJECT_ACTIONS, ObjectColumns

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

    # How often each thing happened to each object. One that was there before is not new, whatever its instances.
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
        """(O, actions) int64: how many there are of each uid to which each thing happened."""
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
    """(I,) int8: the strongest thing that happened to each instance, or to its mesh."""
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
