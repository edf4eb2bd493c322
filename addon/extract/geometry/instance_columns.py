"""What nodes ask of instances (Object Info, attributes of objects and instancers), for all instances at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ...sync.records import Float32Array, InstanceRecords, Int32Array, ObjectRecord
from ..looks.values import Source
from .groups import ObjectTable

_UNUSED_LEVEL = 2**31 - 1  # Blender's filler in a persistent id
_NO_PARENT = -1
_NUMBERS = {"FLOAT": np.float32, "INT": np.int32, "INT8": np.int8, "BOOLEAN": np.bool_}
_VECTORS = {"FLOAT2": 2, "FLOAT_VECTOR": 3}
_COLORS = {"FLOAT_COLOR", "BYTE_COLOR"}

Found = tuple[Float32Array, npt.NDArray[np.bool_]]
Color = tuple[float, float, float, float]
Uint32Array = npt.NDArray[np.uint32]

# How far lookup3's last mixing turns its words.
_TURNS = (14, 11, 25, 16, 4, 14, 24)
# 1 / 2^32: it maps the largest number to one.
_UNIT = np.float32(2.0**-32)
_NOT_LISTED = -1


class InstanceColumns:
    """Answers for the instances of one evaluation, during that evaluation.

    listed_ids: (I,) int64, the random numbers from Blender's list, -1 for instances that were not in it; or None.
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
        # Instances have the viewport colour of their instancer, as Blender's list of instances has it.
        parents = self._instances.parent_indices
        rows = np.where(parents >= 0, parents, self._instances.object_indices)
        return self._of_objects(lambda obj: obj.color if source.kind == "color" else (obj.color[3],) * 4, rows)

    def _random_numbers(self) -> Float32Array:
        numbers = random_ids(self._instances, self._objects.records)
        listed = self._listed_ids
        if listed is not None:
            # Blender's list has no number for objects that are not instanced.
            takes = (self._instances.parent_indices >= 0) & (listed != _NOT_LISTED)
            numbers = np.where(takes, listed, numbers).astype(np.uint32)
        return (numbers.astype(np.float32) * _UNIT)[:, None].repeat(4, axis=1)

    def _evaluated(self, row: int) -> Any:
        return self._objects.originals[row].evaluated_get(self._depsgraph)

    def _of_objects(self, read: Callable[[Any], Any], shown: npt.NDArray[Any] | None = None) -> Float32Array:
        """(I, 4). shown: (I,), the objects' rows; None for those that the instances show."""
        used, rows = np.unique(self._instances.object_indices if shown is None else shown, return_inverse=True)
        values = [read(self._evaluated(int(row))) for row in used]
        return np.array([(0.0,) * 4 if value is None else tuple(value) for value in values], np.float32)[rows]

    def _of_instancers(self, name: str) -> Float32Array:
        """Looks a name up in an instance's maker: its particles' settings, its geometry, itself; then in the object."""
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
        """Looks a name up in particle systems; of several that could show an object, the first counts."""
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


def find_shown_property(obj: Any, name: str) -> Color | None:
    """Find the property of an evaluated object, or else of its data."""
    found = find_property(obj, name)
    return found if found is not None or obj.data is None else find_property(obj.data, name)


def find_property(block: Any, name: str) -> Color | None:
    """(R, G, B, A) of a data-block's property, custom or Blender's own, as attribute nodes find it; a number is grey.

    None if it is missing, or is neither a number nor up to four of them.
    """
    if not name:
        return None
    value = block.get(name)
    if value is None:
        try:
            value = block.path_resolve(name)
        except ValueError:  # no such path
            return None
    return _as_color(value)


def _as_color(value: Any) -> Color | None:
    if isinstance(value, bool | int | float):
        return (float(value),) * 3 + (1.0,)  # type: ignore[return-value]
    if isinstance(value, str) or not hasattr(value, "__len__") or not 0 < len(value) <= 4:
        return None
    channels = list(value)
    if not all(isinstance(channel, float) for channel in channels):
        return None
    red, green, blue, alpha = channels + [0.0, 0.0, 0.0, 1.0][len(channels) :]
    return red, green, blue, alpha


def find_instance_attribute(instancer: Any, name: str, persistent_ids: Int32Array) -> Found:
    """(N, 4) colours and (N,) whether there is one, for instances of an evaluated object (Blender 4.5 and later).

    A persistent id has a level for each nested geometry of an instance, the innermost first. As in Blender, the
    innermost geometry that has the attribute counts.
    """
    count = len(persistent_ids)
    nothing = np.zeros((count, 4), np.float32), np.zeros(count, np.bool_)
    if not hasattr(instancer, "evaluated_geometry") or not any(one.type == "NODES" for one in instancer.modifiers):
        return nothing
    levels = (persistent_ids != _UNUSED_LEVEL).sum(axis=1) - 1
    return _find_in(instancer.evaluated_geometry(), name, persistent_ids, levels)


def _find_in(geometry: Any, name: str, ids: Int32Array, levels: npt.NDArray[np.intp]) -> Found:
    """levels: (N,) which level of each id is this geometry's; below 0 if none is."""
    values, is_found = np.zeros((len(ids), 4), np.float32), np.zeros(len(ids), np.bool_)
    points = geometry.instances_pointcloud()
    count = 0 if points is None else len(points.points)
    if not count or not len(ids):
        return values, is_found
    places = _places(points, ids[np.arange(len(ids)), np.maximum(levels, 0)], count)
    places[levels < 0] = -1
    own = _read_colors(points.attributes.get(name))
    if own is not None:
        is_found = places >= 0
        values[is_found] = own[places[is_found]]
    references = np.empty(count, np.int32)
    points.attributes[".reference_index"].data.foreach_get("value", references)
    kinds = np.where(places >= 0, references[places], -1)
    for number, reference in enumerate(geometry.instance_references()):
        rows = np.flatnonzero(kinds == number)
        shown = _geometry_of(reference) if len(rows) else None
        if shown is not None:
            inner, is_within = _find_in(shown, name, ids[rows], levels[rows] - 1)
            values[rows[is_within]], is_found[rows[is_within]] = inner[is_within], True
    return values, is_found


def _geometry_of(reference: Any) -> Any:
    """Returns the geometry of a reference's instances, if it may have instances itself."""
    if isinstance(reference, bpy.types.GeometrySet):
        return reference
    shows = isinstance(reference, bpy.types.Object) and any(one.type == "NODES" for one in reference.modifiers)
    return reference.evaluated_geometry() if shows else None


def _places(points: Any, ids: Int32Array, count: int) -> npt.NDArray[np.intp]:
    """Which point each id is, -1 for none: its number, or the value of the attribute `id`."""
    own = points.attributes.get("id")
    if own is None:
        return np.where((ids >= 0) & (ids < count), ids, -1).astype(np.intp)
    numbers = np.empty(count, np.int32)
    own.data.foreach_get("value", numbers)
    order = np.argsort(numbers, kind="stable")
    nearest = order[np.minimum(np.searchsorted(numbers[order], ids), count - 1)]
    return np.where(numbers[nearest] == ids, nearest, -1)


def _read_colors(attribute: Any) -> Float32Array | None:
    """(N, 4), or None if it is no number, vector or colour."""
    if attribute is None:
        return None
    kind, count = attribute.data_type, len(attribute.data)
    colors = np.ones((count, 4), np.float32)
    if kind in _NUMBERS:
        numbers = np.empty(count, _NUMBERS[kind])
        attribute.data.foreach_get("value", numbers)
        colors[:, :3] = numbers[:, None]
        return colors
    width = _VECTORS.get(kind, 4 if kind in _COLORS else 0)
    if not width:
        return None
    channels = np.empty((count, width), np.float32)
    attribute.data.foreach_get("color" if kind in _COLORS else "vector", channels.reshape(-1))
    colors[:, 2] = 0.0  # of two channels
    colors[:, :width] = channels
    return colors


def random_ids(instances: InstanceRecords, objects: Sequence[ObjectRecord]) -> Uint32Array:
    """(I,): the number that Blender gives each instance for the node Object Info's output Random.

    Right for those that an instancer makes itself; nested instancers have names that records lack. It is Bob Jenkins'
    hash "lookup3" (2006) of two words, over the object's name, the levels of the persistent id, and the instancer's
    name. Both Blender and Cycles take it for the random number of an instance.
    """
    shown, parents = instances.object_indices, instances.parent_indices
    is_made = parents != _NO_PARENT
    names = np.array([hash_name(obj.name) for obj in objects], np.uint32)
    own = hash_pair(names[shown], np.uint32(0))
    if not is_made.any():
        return own
    uids = np.array([obj.session_uid for obj in objects], np.int64)
    levels = instances.persistent_ids
    hashes = np.where(levels[:, 0] == _UNUSED_LEVEL, own, names[shown])
    for column in levels.T[: int((levels != _UNUSED_LEVEL).sum(axis=1).max())]:
        hashes = np.where(column != _UNUSED_LEVEL, hash_pair(hashes, column.astype(np.uint32)), hashes)
    by_others = uids[shown] != uids[parents]
    hashes = np.where(by_others, hashes ^ hash_pair(names[parents], np.uint32(0)), hashes)
    return np.where(is_made, hashes, own)


def hash_name(name: str) -> int:
    """Hashes a name's bytes in UTF-8."""
    number = 0
    for byte in name.encode():
        number = (number * 37 + byte) & 0xFFFFFFFF
    return number


def hash_pair(first: Uint32Array, second: Uint32Array | np.uint32) -> Uint32Array:
    """Hashes two words, element by element."""
    start = np.uint32(0xDEADBEEF + (2 << 2) + 13)
    words = [first + start, np.broadcast_to(second, first.shape) + start, np.full(first.shape, start, np.uint32)]
    for step, turn in enumerate(_TURNS):
        changed, other = (2 + step) % 3, (1 + step) % 3
        words[changed] = (words[changed] ^ words[other]) - _turned(words[other], turn)
    return words[2]


def _turned(words: Uint32Array, bits: int) -> Uint32Array:
    return (words << np.uint32(bits)) | (words >> np.uint32(32 - bits))
