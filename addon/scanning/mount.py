"""The mount of a sensor: the object that carries it, and all its children, with the instances that they make."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ..sync.records import VISIBLE_TO_CAMERA, SceneRecord


@dataclass(frozen=True, slots=True)
class Mount:
    """name, uid: of the object that carries the sensor. uids: of it and of its children, and theirs; session uids."""

    name: str
    uid: int
    uids: frozenset[int]

    @classmethod
    def of(cls, sensor: bpy.types.Object) -> Mount:
        """Reads who belongs to it. A parent does not: a sensor on an empty sees the car that carries the empty."""
        return cls(
            sensor.name, sensor.session_uid, frozenset(obj.session_uid for obj in (sensor, *sensor.children_recursive))
        )

    def find(self, record: SceneRecord) -> npt.NDArray[np.bool_] | None:
        """(I,) bool: which instances of a record are of the mount; None if none is."""
        is_of = np.array([*(obj.session_uid in self.uids for obj in record.objects), False], np.bool_)
        if not is_of.any():
            return None
        found: Any = is_of[record.instances.object_indices] | is_of[record.instances.parent_indices]
        return found if found.any() else None

    def hide(self, record: SceneRecord) -> SceneRecord:
        """The record with the mount invisible to the sensor's rays."""
        found = self.find(record)
        if found is None:
            return record
        masks = np.where(found, record.instances.masks & ~np.uint32(VISIBLE_TO_CAMERA), record.instances.masks)
        return replace(record, instances=replace(record.instances, masks=masks))


def surrounds(sensor: bpy.types.Object) -> bool:
    """Whether a sensor's object is a mesh around the sensor: the object's origin is inside of the mesh's bounds.

    The bounds are those of the mesh itself, without modifiers: the same in every frame, so that all chunks of a scan
    agree.
    """
    if sensor.type != "MESH" or not len(sensor.data.vertices):
        return False
    positions = np.empty(3 * len(sensor.data.vertices), np.float32)
    sensor.data.vertices.foreach_get("co", positions)
    rows = positions.reshape(-1, 3)
    return bool((rows.min(axis=0) < 0.0).all() and (rows.max(axis=0) > 0.0).all())
