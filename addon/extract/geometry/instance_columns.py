"""What nodes ask of instances (Object Info, attributes of objects and instancers), for all instances at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from ...sync.records import Float32Array, InstanceRecords
from ..looks.instance_sources import Source
from .instance_attributes import find_instance_attribute
from .objects import ObjectTable
from .properties import find_property, find_shown_property
from .random_ids import random_ids

# 1 / 2^32: what the largest number comes to is one.
_UNIT = np.float32(2.0**-32)
_NOT_LISTED = -1


class InstanceColumns:
    """Answers for the instances of one evaluation, while that lasts.

    listed_ids: (I,) int64, the random numbers that Blender's list gave, -1 for what it was not asked for; or None.
    """

    def __init__(
        self,
        depsgraph: Any,
        objects: ObjectTable,
        instances: InstanceRecords,
        listed_ids: npt.NDArray[np.int64] | None,
    ) -> None:
        self._depsgraph = depsgraph
        self._objects = objects
        self._instances = instances
        self._listed_ids = listed_ids
        self._known: dict[Source, Float32Array] = {}

    def of(self, source: Source) -> Float32Array:
        """(I, 4): of a number the same in each channel."""
        if source not in self._known:
            self._known[source] = self._read(source)
        return self._known[source]

    def _read(self, source: Source) -> Float32Array:
        if source.kind == "random":
            return self._random_numbers()
        if source.kind == "location":
            places = self._instances.transforms[:, :, 3]
            return np.concatenate([places, np.ones((len(places), 1), np.float32)], axis=1)
        if source.kind == "object":
            return self._of_objects(lambda obj: find_shown_property(obj, source.name))
        if source.kind == "instancer":
            return self._of_instancers(source.name)
        if source.kind == "object_index":
            return self._of_objects(lambda obj: (obj.pass_index,) * 4)
        return self._of_objects(lambda obj: obj.color if source.kind == "color" else (obj.color[3],) * 4)

    def _random_numbers(self) -> Float32Array:
        numbers = random_ids(self._instances, self._objects.records)
        listed = self._listed_ids
        if listed is not None:
            # Blender's list has no number for what stands there as itself.
            takes = (self._instances.parent_indices >= 0) & (listed != _NOT_LISTED)
            numbers = np.where(takes, listed, numbers).astype(np.uint32)
        return (numbers.astype(np.float32) * _UNIT)[:, None].repeat(4, axis=1)

    def _evaluated(self, row: int) -> Any:
        return self._objects.originals[row].evaluated_get(self._depsgraph)

    def _of_objects(self, read: Callable[[Any], Any]) -> Float32Array:
        used, rows = np.unique(self._instances.object_indices, return_inverse=True)
        values = [read(self._evaluated(int(row))) for row in used]
        return np.array([(0.0,) * 4 if value is None else tuple(value) for value in values], np.float32)[rows]

    def _of_instancers(self, name: str) -> Float32Array:
        """What made an instance has the first word: its particles' settings, its geometry, itself; then the object."""
        found = self._of_objects(lambda obj: find_shown_property(obj, name))
        parents = self._instances.parent_indices
        for row in np.unique(parents[parents >= 0]).tolist():
            instancer = self._evaluated(row)
            of_this = np.flatnonzero(parents == row)
            own = find_property(instancer, name)
            if own is not None:
                found[of_this] = own
            ids = self._instances.persistent_ids[of_this]
            values, is_there = find_instance_attribute(instancer, name, ids)
            found[of_this[is_there]] = values[is_there]
            self._of_particles(instancer, name, of_this, found)
        return found

    def _of_particles(self, instancer: Any, name: str, rows: npt.NDArray[np.intp], found: Float32Array) -> None:
        """Of several particle systems that could show an object, the first counts."""
        uids = np.array([record.session_uid for record in self._objects.records], np.int64)
        shown = uids[self._instances.object_indices[rows]]
        for system in reversed(instancer.particle_systems):
            value = find_property(system.settings, name)
            if value is None:
                continue
            blocks = [system.settings.instance_object]
            if system.settings.instance_collection is not None and system.settings.render_type == "COLLECTION":
                blocks = list(system.settings.instance_collection.all_objects)
            may_show = [block.original.session_uid for block in blocks if block is not None]
            found[rows[np.isin(shown, may_show)]] = value
