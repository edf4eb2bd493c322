"""What differs between the scene as the engine holds it and a new record: pure functions, nothing is changed.

Arrays are compared as they are, not by hash: that is as fast as reading them once, and never wrong.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from .keys import Int64Array, Uint64Array, match_keys
from .records import Float64Array, Int32Array, MeshRecord, SceneRecord

MeshAction = Literal["added", "removed", "replaced", "deformed", "kept"]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class HeldInstances:
    """The instances that the engine holds, as columns, in the order of the record they came from.

    keys: (I,) uint64. ids: (I,) int32, the engine's. mesh_keys: for each instance's mesh_indices, the key of
    that mesh. object_uids: (I,) int64. Others as in `InstanceRecords`; orders as given to the engine.
    """

    keys: Uint64Array
    ids: Int32Array
    mesh_indices: Int32Array
    mesh_keys: tuple[Hashable, ...]
    transforms: Float64Array
    masks: npt.NDArray[np.uint32]
    orders: Int64Array
    object_uids: Int64Array

    @classmethod
    def none(cls) -> HeldInstances:
        """No instances."""
        return cls(
            keys=np.empty(0, np.uint64),
            ids=np.empty(0, np.int32),
            mesh_indices=np.empty(0, np.int32),
            mesh_keys=(),
            transforms=np.empty((0, 4, 4), np.float64),
            masks=np.empty(0, np.uint32),
            orders=np.empty(0, np.int64),
            object_uids=np.empty(0, np.int64),
        )


@dataclass(frozen=True, slots=True)
class MeshDifference:
    """What happened to one mesh, why, and whether any attribute beside the geometry changed."""

    action: MeshAction
    reason: str
    attributes_changed: bool = False


@dataclass(frozen=True, slots=True)
class InstanceDifference:
    """What happened to the instances of a new record.

    held_rows: (I,) int32, the row of the same instance among those held, -1 for one to be added.
    moved, masked: (I,) bool, instances that stay but are moved or seen by other rays.
    removed: (H,) bool over the held ones. is_swapped: (I,) bool, added only because what they show is another mesh.
    """

    held_rows: Int32Array
    moved: BoolArray
    masked: BoolArray
    removed: BoolArray
    is_swapped: BoolArray

    @property
    def added(self) -> BoolArray:
        """(I,) bool."""
        return np.asarray(self.held_rows < 0)

    @property
    def kept(self) -> BoolArray:
        """(I,) bool: neither added, moved nor masked."""
        return ~(self.added | self.moved | self.masked)


def compare_mesh(old: MeshRecord | None, new: MeshRecord) -> MeshDifference:
    """Compares a mesh with the one held under the same key, None if there is none."""
    if old is None:
        return MeshDifference("added", "seen for the first time")
    attributes_changed = not _have_same(old, new, "polygon_ids", "material_slots", "corner_normals", "corner_uvs")
    reason = _topology_change(old, new)
    if reason:
        return MeshDifference("replaced", reason, attributes_changed)
    if not np.array_equal(old.positions, new.positions):
        return MeshDifference("deformed", "vertices moved, triangles stayed", attributes_changed)
    return MeshDifference("kept", "same triangles, same positions", attributes_changed)


def _topology_change(old: MeshRecord, new: MeshRecord) -> str | None:
    if len(old.triangles) != len(new.triangles):
        return f"{len(new.triangles)} triangles, {len(old.triangles)} before"
    if len(old.positions) != len(new.positions):
        return f"{len(new.positions)} vertices, {len(old.positions)} before"
    if not np.array_equal(old.triangles, new.triangles):
        return "as many triangles, but others"
    return None


def _have_same(old: Any, new: Any, *names: str) -> bool:
    return all(_are_equal(getattr(old, name), getattr(new, name)) for name in names)


def _are_equal(old: npt.NDArray[Any] | None, new: npt.NDArray[Any] | None) -> bool:
    if old is None or new is None:
        return old is new
    return np.array_equal(old, new)


def compare_instances(
    held: HeldInstances, record: SceneRecord, keys: Uint64Array, orders: Int64Array, held_meshes: Mapping[Hashable, Any]
) -> InstanceDifference:
    """Compares instances; held_meshes: the keys of the meshes that the engine holds now."""
    instances = record.instances
    rows = match_keys(held.keys, keys)
    same_mesh = _shows_same_mesh(held, record, rows, held_meshes)
    stays = same_mesh & (held.orders[rows] == orders) if len(held.keys) else np.zeros(len(rows), np.bool_)
    is_swapped = (rows >= 0) & ~stays
    rows = np.where(stays, rows, -1).astype(np.int32)

    moved = np.zeros(len(rows), np.bool_)
    masked = np.zeros(len(rows), np.bool_)
    if stays.any():
        old = rows[stays]
        moved[stays] = (held.transforms[old] != instances.transforms[stays]).any(axis=(1, 2))
        masked[stays] = held.masks[old] != instances.masks[stays]
    removed = np.ones(len(held.keys), np.bool_)
    removed[rows[stays]] = False
    return InstanceDifference(rows, moved, masked, removed, is_swapped)


def _shows_same_mesh(
    held: HeldInstances, record: SceneRecord, rows: Int32Array, held_meshes: Mapping[Hashable, Any]
) -> BoolArray:
    """(I,) bool: the instance is held and shows the mesh with the same key as before."""
    if not len(held.keys):
        return np.zeros(len(rows), np.bool_)
    old_index_of_key = {key: index for index, key in enumerate(held.mesh_keys) if key in held_meshes}
    old_indices = np.array([old_index_of_key.get(mesh.key, -1) for mesh in record.meshes], np.int32)
    wanted = old_indices[record.instances.mesh_indices] if len(record.meshes) else np.empty(0, np.int32)
    shows_same: BoolArray = (rows >= 0) & (wanted >= 0) & (held.mesh_indices[rows] == wanted)
    return shows_same
