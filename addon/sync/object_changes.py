"""From what happened to instances and meshes to what happened to each object, without a loop over instances."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .compare import BoolArray, HeldInstances, InstanceDifference, MeshAction
from .records import SceneRecord
from .report import OBJECT_ACTIONS, ObjectColumns

Int64Array = npt.NDArray[np.int64]

_RANK: dict[str, int] = {action: rank for rank, action in enumerate(OBJECT_ACTIONS)}


def instance_uids(record: SceneRecord) -> Int64Array:
    """(I,) int64: the session uid of each instance's object."""
    uids = np.array([obj.session_uid for obj in record.objects], np.int64)
    return uids[record.instances.object_indices] if len(uids) else np.empty(0, np.int64)


def summarise_objects(
    held: HeldInstances,
    held_names: dict[int, str],
    record: SceneRecord,
    difference: InstanceDifference,
    mesh_actions: list[MeshAction],
) -> ObjectColumns:
    """One row an object that has instances, or had.

    held_names: session uid -> name, of the objects before. mesh_actions: of each of the record's meshes.
    """
    new_uids = instance_uids(record)
    gone_uids = held.object_uids[difference.removed]
    uids, places = np.unique(np.concatenate([new_uids, gone_uids]), return_inverse=True)
    new_places, gone_places = places[: len(new_uids)], places[len(new_uids) :]

    was_there = np.isin(uids, held.object_uids)
    ranks = _instance_ranks(record, difference, mesh_actions)
    ranks[difference.added & ~difference.is_swapped] = _RANK["added"]
    # An object that was there before is not new, whatever the number of its instances.
    ranks[(ranks == _RANK["added"]) & was_there[new_places]] = _RANK["recounted"]

    instance_counts = np.bincount(new_places, minlength=len(uids)).astype(np.int64)
    gone_counts = _gone_counts(gone_places, new_places[difference.is_swapped], len(uids))
    actions = np.where(gone_counts > 0, _RANK["recounted"], _RANK["kept"]).astype(np.int8)
    np.maximum.at(actions, new_places, ranks)
    actions[instance_counts == 0] = _RANK["removed"]

    names = {**held_names, **{obj.session_uid: obj.name for obj in record.objects}}
    return ObjectColumns(
        names=np.array([names[int(uid)] for uid in uids], dtype=object),
        session_uids=uids.astype(np.int64),
        actions=actions,
        instance_counts=instance_counts,
        changed_counts=_changed_counts(new_places, ranks > 0, len(uids)) + gone_counts,
    )


def _instance_ranks(
    record: SceneRecord, difference: InstanceDifference, mesh_actions: list[MeshAction]
) -> npt.NDArray[np.int8]:
    """(I,) int8: the strongest thing that happened to each instance, or to its mesh; additions apart."""
    instances = record.instances
    ranks = np.zeros(len(instances), np.int8)
    ranks[difference.masked] = _RANK["masked"]
    ranks[difference.moved] = _RANK["moved"]
    ranks[difference.is_swapped] = _RANK["replaced"]
    if len(instances):
        # A mesh that is new is news of an instance only if the instance is new, or shows another mesh than before.
        mesh_ranks = [0 if action == "added" else _RANK[action] for action in mesh_actions]
        ranks = np.maximum(ranks, np.array(mesh_ranks, np.int8)[instances.mesh_indices])
    return ranks


def _changed_counts(places: npt.NDArray[np.intp], changed: BoolArray, count: int) -> Int64Array:
    return np.bincount(places[changed], minlength=count).astype(np.int64)


def _gone_counts(gone: npt.NDArray[np.intp], swapped: npt.NDArray[np.intp], count: int) -> Int64Array:
    """Instances that are gone for good: a swapped one was removed only to be added again."""
    difference = np.bincount(gone, minlength=count) - np.bincount(swapped, minlength=count)
    gone_counts: Int64Array = np.maximum(difference, 0).astype(np.int64)
    return gone_counts
