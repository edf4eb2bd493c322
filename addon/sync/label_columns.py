"""Labels by name as columns: whole numbers, numbers, or rows of a table of names. Knows no Blender."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .records import SceneRecord

Float64Array = npt.NDArray[np.float64]
LabelValue = int | float | str | None
MISSING = -1


@dataclass(frozen=True, slots=True)
class LabelTable:
    """What the values of a label are.

    names: of a label whose values are rows of them; None for numbers. missing: the value where nothing has the label:
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
        """What an encoded value stands for: a text, a number, None for none."""
        if np.isnan(value) or value == self.missing:
            return None
        if self.names is not None:
            return self.names[int(value)]
        return int(value) if self.is_whole else float(value)

    def described(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "names": None if self.names is None else list(self.names),
            "missing": self.missing if self.is_whole else None,
        }


@dataclass(frozen=True, slots=True, eq=False)
class LabelColumn:
    """values: int32 or float64, of N points or H x W pixels. table: what they stand for."""

    values: npt.NDArray[Any]
    table: LabelTable

    @property
    def names(self) -> tuple[str, ...] | None:
        """What values are rows of; None for numbers."""
        return self.table.names

    def value_at(self, place: Any) -> LabelValue:
        """What stands at an index: a text, a number, None where nothing has the label."""
        return self.table.value_of(self.values[place])


@dataclass(frozen=True, slots=True, eq=False)
class SceneLabel:
    """One label of a scene's record. of_instances: (I,) and of_materials: (M,) float64, NaN for none."""

    of_instances: Float64Array
    of_materials: Float64Array
    table: LabelTable

    def at(self, instance_rows: npt.NDArray[Any], material_rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """(R,) encoded, where rays met instances; rows of the record's instances and materials, -1 for none."""
        values = _with_none(self.of_instances)[instance_rows]
        values = np.where(np.isnan(values), _with_none(self.of_materials)[material_rows], values)
        return self.table.encode(values)

    def of_things(self, record: SceneRecord, instance_rows: npt.NDArray[Any]) -> list[LabelValue]:
        """Of whole instances: what all their materials agree on counts where they have no label themselves."""
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
