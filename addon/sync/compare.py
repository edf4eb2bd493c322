"""The differences between the scene in the engine and a new record: pure functions, which change nothing.

Arrays are compared directly, not by hash: that is as fast as reading them once, and never wrong.
"""

from __future__ import annotations

from collections.abc import Container, Hashable
from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from perfect_bvh.bulk import are_equal, find_moved

from .keys import Int64Array, PlacedInstances, Uint64Array, match_keys
from .look_records import ImageRecord
from .records import (
    MESH_COLUMNS,
    MESH_LAYERS,
    CameraRecord,
    InstanceRecords,
    Int32Array,
    Layers,
    MeshRecord,
    ObjectRecord,
    SceneRecord,
)

MeshAction = Literal["added", "removed", "replaced", "deformed", "kept"]
BoolArray = npt.NDArray[np.bool_]
_OF_THE_FILM = ("film_transparent", "plain_reflectance", "pass_alpha_threshold")
# A mesh's attributes for each of its triangles and corners, without the geometry.
ATTRIBUTES = tuple(name for name in MESH_COLUMNS if name not in {"positions", "triangles", "radii", "curve_offsets"})


@dataclass(frozen=True, slots=True)
class HeldInstances:
    """The instances that the engine holds, as columns, in the order of the record they came from.

    columns: the record's own. keys: (I,) uint64. ids: (I,) int32, the engine's. orders: (I,) int64, as given to the
    engine. meshes, objects: the meanings of the columns' rows.
    """

    columns: InstanceRecords = field(default_factory=InstanceRecords)
    keys: Uint64Array = field(default_factory=lambda: np.empty(0, np.uint64))
    ids: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    orders: Int64Array = field(default_factory=lambda: np.empty(0, np.int64))
    meshes: tuple[MeshRecord, ...] = ()
    objects: tuple[ObjectRecord, ...] = ()

    def are_those_of(self, record: SceneRecord) -> bool:
        """Whether the record's instances are the same ones in the same order, as its sharing of arrays shows.

        What they show and where may differ all the same.
        """
        return are_same_instances(self.columns, self.objects, record)

    def shows_meshes_of(self, record: SceneRecord, held_meshes: Container[Hashable]) -> bool:
        """Whether each instance shows the mesh that it shows in the record, if they are the same instances."""
        if self.columns.mesh_indices is not record.instances.mesh_indices:
            return False
        if self.meshes is record.meshes:
            return True
        keys = [mesh.key for mesh in record.meshes]
        return keys == [mesh.key for mesh in self.meshes] and all(key in held_meshes for key in keys)


@dataclass(frozen=True, slots=True)
class MeshDifference:
    """The change of one mesh, its reason, and whether any attribute other than the geometry changed."""

    action: MeshAction
    reason: str
    attributes_changed: bool = False


# Of a mesh that is the very record that is held.
UNCHANGED = MeshDifference("kept", "Blender did not evaluate it again")


@dataclass(frozen=True, slots=True)
class InstanceDifference:
    """The changes of the instances in a new record.

    held_rows: (I,) int32, the row of the same instance among those held, -1 for one to be added.
    moved, masked: (I,) bool, instances that stay but are moved or seen by other rays.
    removed: (H,) bool over the held ones. is_swapped: (I,) bool, added only because their mesh is another one.
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
    if old is new:
        return UNCHANGED
    if old is None:
        return MeshDifference("added", "seen for the first time")
    attributes_changed = not (have_same(old, new, *ATTRIBUTES) and have_same_layers(old, new))
    reason = topology_change(old, new)
    if reason:
        return MeshDifference("replaced", reason, attributes_changed)
    parts = new.kind
    if not have_same(old, new, "positions", "radii"):
        moved = "vertices" if parts == "triangles" else "points"
        return MeshDifference("deformed", f"{moved} moved, {parts} are the same", attributes_changed)
    reason = f"same {parts}, same positions" if new.was_read else UNCHANGED.reason
    return MeshDifference("kept", reason, attributes_changed)


def topology_change(old: MeshRecord, new: MeshRecord) -> str | None:
    """Returns why the new mesh is more than the old one with other positions or radii; None if it is not."""
    if old.form != new.form:
        return f"{new.kind} of another kind"
    if old.part_count != new.part_count:
        return f"{new.part_count} {new.kind}, {old.part_count} before"
    if len(old.positions) != len(new.positions):
        return f"{len(new.positions)} vertices, {len(old.positions)} before"
    if not have_same(old, new, "triangles", "curve_offsets"):
        return f"as many {new.kind}, but others"
    return None


def have_same_layers(old: MeshRecord, new: MeshRecord) -> bool:
    """Whether the arrays that have names are equal."""
    return all(_have_equal_items(getattr(old, name), getattr(new, name)) for name in MESH_LAYERS)


def _have_equal_items(old: Layers, new: Layers) -> bool:
    return old.keys() == new.keys() and all(_are_equal(array, new[name]) for name, array in old.items())


def have_same(old: Any, new: Any, *names: str) -> bool:
    """Whether the arrays of these names are equal."""
    return all(_are_equal(getattr(old, name), getattr(new, name)) for name in names)


def _are_equal(old: npt.NDArray[Any] | None, new: npt.NDArray[Any] | None) -> bool:
    if old is new or old is None or new is None:
        return old is new
    return are_equal(old, new)


def compare_instances(
    held: HeldInstances, record: SceneRecord, keys: Uint64Array, orders: Int64Array, held_meshes: Container[Hashable]
) -> InstanceDifference:
    """Compares instances; held_meshes: the keys of the meshes that the engine holds now."""
    instances = record.instances
    if keys is held.keys and held.shows_meshes_of(record, held_meshes):
        return _compare_same(held, instances, np.arange(len(keys), dtype=np.int32))
    rows = match_keys(held.keys, keys)
    stays = _shows_same_mesh(held, record, rows, held_meshes)
    if len(held.keys) and orders is not held.orders:
        stays &= held.orders[rows] == orders
    if stays.all() and len(rows) == len(held.keys):
        return _compare_same(held, instances, rows)
    is_swapped = (rows >= 0) & ~stays
    rows = np.where(stays, rows, -1).astype(np.int32)
    masked = np.zeros(len(rows), np.bool_)
    masked[stays] = held.columns.masks[rows[stays]] != instances.masks[stays]
    removed = np.ones(len(held.keys), np.bool_)
    removed[rows[stays]] = False
    moved = find_moved(held.columns.transforms, instances.transforms, rows)
    return InstanceDifference(rows, moved, masked, removed, is_swapped)


def _compare_same(held: HeldInstances, instances: InstanceRecords, rows: Int32Array) -> InstanceDifference:
    """Compares records with the same instances, possibly in another order."""
    none = np.zeros(len(rows), np.bool_)
    same_masks = held.columns.masks is instances.masks
    return InstanceDifference(
        held_rows=rows,
        moved=find_moved(held.columns.transforms, instances.transforms, rows),
        masked=none if same_masks else held.columns.masks[rows] != instances.masks,
        removed=none,
        is_swapped=none,
    )


def _shows_same_mesh(
    held: HeldInstances, record: SceneRecord, rows: Int32Array, held_meshes: Container[Hashable]
) -> BoolArray:
    """(I,) bool: the instance is held and shows the mesh with the same key as before."""
    if not len(held.keys):
        return np.zeros(len(rows), np.bool_)
    old_index_of_key = {mesh.key: index for index, mesh in enumerate(held.meshes) if mesh.key in held_meshes}
    old_indices = np.array([old_index_of_key.get(mesh.key, -1) for mesh in record.meshes], np.int32)
    wanted = old_indices[record.instances.mesh_indices] if len(record.meshes) else np.empty(0, np.int32)
    shows_same: BoolArray = (rows >= 0) & (wanted >= 0) & (held.columns.mesh_indices[rows] == wanted)
    return shows_same


def are_same_instances(instances: InstanceRecords, objects: tuple[ObjectRecord, ...], record: PlacedInstances) -> bool:
    """Whether these are a record's instances, in the same order, as the sharing of arrays shows."""
    names = ("object_indices", "parent_indices", "persistent_ids")
    if not all(getattr(instances, name) is getattr(record.instances, name) for name in names):
        return False
    return objects is record.objects or uids_of(objects) == uids_of(record.objects)


def is_same_camera(first: CameraRecord, second: CameraRecord) -> bool:
    """Whether two cameras see the same."""
    names = ("window", "projection", "clip_start", "clip_end", "border", "lens")
    same_settings = all(getattr(first, name) == getattr(second, name) for name in names)
    return same_settings and bool(np.array_equal(first.matrix, second.matrix))


def uids_of(objects: tuple[ObjectRecord, ...]) -> list[int]:
    """The session uid of each."""
    return [obj.session_uid for obj in objects]


def find_look_differences(old: SceneRecord, new: SceneRecord) -> tuple[str, ...]:
    """Find where two records look different although their geometry may be the same.

    In words: "materials", "objects", "film", "world", "lights", "instance values", "images".
    """
    found = [name for name in ("materials", "objects", "world") if getattr(old, name) != getattr(new, name)]
    if any(getattr(old, name) != getattr(new, name) for name in _OF_THE_FILM):
        found.append("film")
    if _differ(old.lights, new.lights):
        found.append("lights")
    if not _are_equal(old.instance_values, new.instance_values):
        found.append("instance values")
    if len(old.images) != len(new.images) or any(map(_are_unlike, old.images, new.images)):
        found.append("images")
    return tuple(found)


def _are_unlike(old: ImageRecord, new: ImageRecord) -> bool:
    if old is new:
        return False
    if [*old.tiles] != [*new.tiles] or _differ(old, new, "tiles"):
        return True
    pairs = [(pixels, new.tiles[number]) for number, pixels in old.tiles.items()]
    return any(first is not second and not np.array_equal(first, second) for first, second in pairs)


def _differ(old: Any, new: Any, *left_out: str) -> bool:
    names = [field.name for field in fields(old) if field.name not in left_out]
    columns = [(getattr(old, name), getattr(new, name)) for name in names]
    return any(first is not second and not np.array_equal(first, second) for first, second in columns)
