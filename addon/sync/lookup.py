"""From the engine's ids back to objects, polygons and materials: arrays in, arrays out, no loop over rays."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from .keys import Int64Array
from .records import Int32Array, MeshRecord, SceneRecord

MISS = -1
# A table indexed by id is the fastest; ids that are spread wider than this are searched for instead.
_MAXIMUM_SPREAD = 8


class HitIds(Protocol):
    """The part of `perfect_bvh.Hits` that lookups use; ids (...) int32, -1 on a miss.

    scene_id, generation: which scene answered, and after how many commits.
    """

    @property
    def scene_id(self) -> int: ...
    @property
    def generation(self) -> int: ...

    @property
    def instance_ids(self) -> Int32Array: ...
    @property
    def mesh_ids(self) -> Int32Array: ...
    @property
    def primitive_ids(self) -> Int32Array: ...


class InstanceDescription(NamedTuple):
    """Descriptions of instances, in the shape of the requested ids.

    names: (...) object array of str, the object's name. session_uids: (...) int64, the object's.
    parent_names, parent_session_uids: of the instancer, "" and 0 for a plain object. persistent_ids: (..., 8) int32,
    Blender's, zero for a plain object. A miss has "", 0 and -1.
    """

    names: npt.NDArray[np.object_]
    session_uids: npt.NDArray[np.int64]
    persistent_ids: Int32Array
    parent_names: npt.NDArray[np.object_]
    parent_session_uids: npt.NDArray[np.int64]


class IdRows:
    """Finds the row of an id among distinct ids."""

    def __init__(self, ids: Int32Array) -> None:
        self._first = int(ids.min()) if len(ids) else 0
        spread = int(ids.max()) - self._first + 1 if len(ids) else 0
        self._order: npt.NDArray[np.intp] | None = None
        self._ids = ids
        if spread <= _MAXIMUM_SPREAD * len(ids) + 1024:
            self._table = np.full(spread, MISS, np.int32)
            self._table[ids - self._first] = np.arange(len(ids), dtype=np.int32)
        else:
            self._order = np.argsort(ids)

    def find(self, ids: npt.NDArray[Any], what: str) -> Int32Array:
        """(...) int32: the row of each id, MISS for a miss. Raises ValueError for an id that is not there."""
        is_miss = ids == MISS
        rows = self._search(ids)
        unknown = (rows == MISS) & ~is_miss
        if unknown.any():
            raise ValueError(f"{what} {int(ids[unknown].flat[0])} is not part of the synced scene")
        rows[is_miss] = MISS
        return rows

    def _search(self, ids: npt.NDArray[Any]) -> Int32Array:
        if self._order is not None:
            places = np.minimum(np.searchsorted(self._ids, ids, sorter=self._order), len(self._ids) - 1)
            found = self._order[places]
            return np.where(self._ids[found] == ids, found, MISS).astype(np.int32)
        places = ids.astype(np.int64) - self._first
        inside = (places >= 0) & (places < len(self._table))
        if not len(self._table):
            return np.full(ids.shape, MISS, np.int32)
        return np.where(inside, self._table[np.where(inside, places, 0)], MISS).astype(np.int32)


class SceneLookup:
    """Answers for one applied record; tables are made on first use.

    instance_ids: (I,) and mesh_ids: (M,), the engine's ids of the record's instances and meshes.
    scene_id: of the engine's scene. mesh_generations: (M,) since which of its commits each mesh has its triangles.
    """

    def __init__(
        self,
        record: SceneRecord,
        instance_ids: Int32Array,
        mesh_ids: Int32Array,
        scene_id: int,
        mesh_generations: Int64Array,
    ) -> None:
        self._scene_id = scene_id
        self._generations = np.append(mesh_generations, 0)  # a miss's row is the last
        self._record = record
        self._instances = IdRows(instance_ids)
        self._meshes = IdRows(mesh_ids)
        self._columns: dict[str, Int32Array] = {}
        self._offsets = _offsets([mesh.part_count for mesh in record.meshes])
        self._slot_offsets = _offsets([len(obj.material_slots) for obj in record.objects])
        self._slot_materials = np.array([row for obj in record.objects for row in obj.material_slots], np.int32)

    def instance_rows(self, instance_ids: npt.NDArray[Any]) -> Int32Array:
        """(...) int32: rows of the record's instances, -1 for a miss."""
        return self._instances.find(instance_ids, "instance_rows: instance")

    def describe(self, instance_ids: npt.ArrayLike) -> InstanceDescription:
        """Names, session uids and persistent ids of instances, -1 for a miss; see `InstanceDescription`."""
        ids = np.asarray(instance_ids)
        if ids.dtype.kind not in "iu":
            raise ValueError(f"describe: instance_ids must hold integers, got {ids.dtype}")
        rows = self._instances.find(ids, "describe: instance")
        instances, objects = self._record.instances, self._record.objects
        # Row -1 of each table is the answer for a miss.
        names = _object_array([*(obj.name for obj in objects), ""])
        uids = np.array([*(obj.session_uid for obj in objects), 0], np.int64)
        object_rows = np.append(instances.object_indices, MISS)[rows]
        parent_rows = np.append(instances.parent_indices, MISS)[rows]
        miss = np.full((1, 8), MISS, np.int32)
        return InstanceDescription(
            names=names[object_rows],
            session_uids=uids[object_rows],
            persistent_ids=np.concatenate([instances.persistent_ids, miss])[rows],
            parent_names=names[parent_rows],
            parent_session_uids=uids[parent_rows],
        )

    def polygon_ids(self, hits: HitIds) -> Int32Array:
        """(...) int32: the polygon of the evaluated mesh, the curve or the point that each ray hit, -1 on a miss."""
        return self._per_triangle("polygon_ids", hits)

    def triangle_ids(self, hits: HitIds) -> Int32Array:
        """(...) int32: the triangle of the evaluated mesh, as Blender counts them, -1 on a miss.

        Differs from the engine's primitive_ids only where triangles were left out because they are not finite.
        """
        return self._per_triangle("triangle_ids", hits)

    def material_ids(self, hits: HitIds) -> Int32Array:
        """(...) int32: the row of `material_names` that each ray hit; -1 on a miss and for an empty slot.

        Raises ValueError if the material slots of the meshes were not read.
        """
        slots = self._per_triangle("material_slots", hits)
        rows = self._instances.find(np.asarray(hits.instance_ids), "material_ids: instance")
        objects = np.append(self._record.instances.object_indices, MISS)[rows]
        firsts = np.append(self._slot_offsets[:-1], 0)[objects]
        counts = np.append(np.diff(self._slot_offsets), 0)[objects]
        # Blender shows triangles of a slot that the object does not have in its last one.
        places = firsts + np.minimum(slots, counts - 1)
        has_slot = (objects >= 0) & (counts > 0)
        materials = np.append(self._slot_materials, MISS)
        return np.where(has_slot, materials[np.where(has_slot, places, -1)], MISS).astype(np.int32)

    def _per_triangle(self, name: str, hits: HitIds) -> Int32Array:
        primitives = np.asarray(hits.primitive_ids)
        meshes = self._meshes.find(np.asarray(hits.mesh_ids), f"{name}: mesh")
        is_hit = meshes >= 0
        self._check_age(name, hits, meshes)
        counts = np.append(np.diff(self._offsets), 0)  # a miss's row is the last
        unknown = is_hit & ((primitives < 0) | (primitives >= counts[meshes]))
        if unknown.any():
            raise ValueError(
                f"{name}: triangle {int(primitives[unknown].flat[0])} is not part of the synced scene: describe hits "
                "before the next update()"
            )
        column = self._column(name)
        if not len(column):
            return np.full(primitives.shape, MISS, np.int32)
        places = np.where(is_hit, self._offsets[meshes] + primitives, 0)
        return np.where(is_hit, column[places], MISS).astype(np.int32)

    def _check_age(self, name: str, hits: HitIds, meshes: Int32Array) -> None:
        """Raises ValueError for hits on triangles that are no longer what they were."""
        again = "cast the rays again, and look up hits before the next update()"
        if hits.scene_id != self._scene_id:
            raise ValueError(f"{name}: hits must come from the synced scene, got hits of another scene: {again}")
        is_old = self._generations[meshes] > hits.generation
        if is_old.any():
            mesh_id = int(np.asarray(hits.mesh_ids)[is_old].flat[0])
            raise ValueError(
                f"{name}: hits must be from after the last update() that replaced what they hit, got hits of "
                f"generation {hits.generation} on mesh {mesh_id}, whose triangles were replaced since: {again}"
            )

    def _column(self, name: str) -> Int32Array:
        """One value for each triangle of all meshes, one mesh after the other."""
        column = self._columns.get(name)
        if column is None:
            column = self._columns[name] = np.concatenate(
                [np.empty(0, np.int32), *(_mesh_column(mesh, name) for mesh in self._record.meshes)]
            )
        return column


def _mesh_column(mesh: MeshRecord, name: str) -> Int32Array:
    values: Int32Array | None = getattr(mesh, name)
    if mesh.kind != "triangles":  # curves and points have no polygons, and mostly all the first slot
        if name == "material_slots":
            return np.zeros(mesh.part_count, np.int32) if values is None else values
        return np.arange(mesh.part_count, dtype=np.int32) if mesh.triangle_ids is None else mesh.triangle_ids
    if values is not None:
        return values
    if name == "triangle_ids":
        return np.arange(len(mesh.triangles), dtype=np.int32)
    raise ValueError(f"the meshes' {name} were not read: request() them and update()")


def _offsets(counts: Sequence[int]) -> npt.NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]).astype(np.int64)


def _object_array(values: Sequence[str]) -> npt.NDArray[np.object_]:
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array


# Label columns -------------------------------------------------------------------------------------------------------
# Labels by name as columns: whole numbers, numbers, or rows of a table of names. Does not depend on Blender.


Float64Array = npt.NDArray[np.float64]
LabelValue = int | float | str | None
MISSING = -1


@dataclass(frozen=True, slots=True)
class LabelTable:
    """The meaning of a label's values.

    names: of a label whose values are their rows; None for numbers. missing: the value of objects without the label:
    -1 for rows of names and whole numbers, NaN for floats. Numbers are floats if any has a fraction or is -1 itself.
    """

    names: tuple[str, ...] | None
    missing: int | float

    @property
    def is_whole(self) -> bool:
        """Whether values are int32, and not float64."""
        return isinstance(self.missing, int)

    def encode(self, values: Float64Array) -> npt.NDArray[Any]:
        """(...) int32 or float64 of (...) float64 with NaN where there is none."""
        if not self.is_whole:
            return values
        return np.where(np.isnan(values), self.missing, values).astype(np.int32)

    def value_of(self, value: float) -> LabelValue:
        """Decodes a value: a text, a number, None for none."""
        if np.isnan(value) or value == self.missing:
            return None
        if self.names is not None:
            return self.names[int(value)]
        return int(value) if self.is_whole else float(value)

    def described(self) -> dict[str, Any]:
        """Returns the table as JSON has it."""
        return {
            "names": None if self.names is None else list(self.names),
            "missing": self.missing if self.is_whole else None,
        }


@dataclass(frozen=True, slots=True, eq=False)
class LabelColumn:
    """values: int32 or float64, of N points or H x W pixels. table: their meaning."""

    values: npt.NDArray[Any]
    table: LabelTable

    @property
    def names(self) -> tuple[str, ...] | None:
        """The names of which values are rows; None for numbers."""
        return self.table.names

    def value_at(self, place: Any) -> LabelValue:
        """Returns the value at an index: a text, a number, None where the label is missing."""
        return self.table.value_of(self.values[place])


@dataclass(frozen=True, slots=True, eq=False)
class SceneLabel:
    """One label of a scene's record. of_instances: (I,) and of_materials: (M,) float64, NaN for none."""

    of_instances: Float64Array
    of_materials: Float64Array
    table: LabelTable

    def at(self, instance_rows: npt.NDArray[Any], material_rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """(R,) encoded, where rays hit instances; rows of the record's instances and materials, -1 for none."""
        values = _with_none(self.of_instances)[instance_rows]
        values = np.where(np.isnan(values), _with_none(self.of_materials)[material_rows], values)
        return self.table.encode(values)

    def of_things(self, record: SceneRecord, instance_rows: npt.NDArray[Any]) -> list[LabelValue]:
        """Returns the labels of whole instances: without a label, they get the common label of all their materials."""
        agreed = np.array([_agreed(self.of_materials, obj.material_slots) for obj in record.objects] or [np.nan])
        values = self.of_instances[instance_rows]
        values = np.where(np.isnan(values), agreed[record.instances.object_indices[instance_rows]], values)
        return [self.table.value_of(value) for value in self.table.encode(values)]


def _with_none(values: Float64Array) -> Float64Array:
    """Row -1 is that of nothing."""
    return np.append(values, np.nan)


def _agreed(of_materials: Float64Array, slots: Sequence[int]) -> float:
    found = {float(of_materials[row]) if row >= 0 else np.nan for row in slots}
    return found.pop() if len(found) == 1 else np.nan


@dataclass(frozen=True, slots=True)
class OwnerValues:
    """The values of a label, by the session uids of the objects that have them or whose data does, and of materials.

    by_object, by_data: of objects. from_object ... from_material: which may say a label, in the order of the fields:
    the object, its instancer, the object's data, its instancer's, and where no other does the material.
    """

    by_object: Mapping[int, float]
    by_data: Mapping[int, float]
    by_material: Mapping[int, float]
    from_object: bool = True
    from_instancer: bool = True

    def of(self, record: SceneRecord, table: LabelTable) -> SceneLabel:
        """Brought to the rows of a record."""
        uids = [obj.session_uid for obj in record.objects]
        values = np.full(len(record.instances), np.nan)
        for column in self._by_rank(record, uids):
            values = np.where(np.isnan(values), column, values)
        materials = _looked_up(self.by_material, [material.session_uid for material in record.materials])
        return SceneLabel(values, materials, table)

    def _by_rank(self, record: SceneRecord, uids: list[int]) -> Iterator[Float64Array]:
        objects, parents = record.instances.object_indices, record.instances.parent_indices
        for known in (self.by_object, self.by_data):
            values = _with_none(_looked_up(known, uids))
            if self.from_object:
                yield values[objects]
            if self.from_instancer:
                yield values[parents]


def _looked_up(values: Mapping[int, float], uids: list[int]) -> Float64Array:
    return np.array([values.get(uid, np.nan) for uid in uids], np.float64)
