"""The instances of one evaluation as columns, however they were found; and Blender's own list of them.

Blender gives matrices and persistent ids in bulk. Which object and which mesh an instance shows it does not, so
one lean loop asks that; all that depends on it is looked up once per group. `geometry_instances.py` does without
the list where it can.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from perfect_bvh.bulk import place_instances

from ...sync.records import LARGEST_COORDINATE, Float32Array, Int32Array
from ..looks.values import RANDOM
from .groups import NOT_SHOWN, GroupTable
from .particle_hair import has_strands

_LEVELS = 8  # of a persistent id


@dataclass(frozen=True, slots=True)
class Listing:
    """N instances in the depsgraph's own order.

    group_ids: (N,) int32, rows of the groups, or NOT_SHOWN. transforms: (N, 3, 4) float32. bad_rows: (B,) int32, those
    whose transform is useless. ids: (N, ...) int32, which distinguish the instances of a group.
    expand_ids: makes (N, 8) persistent ids from group_ids and ids. is_plain: whether it contains only the evaluated
    objects themselves, in their order. random_ids: (N,) int64, Blender's random number for each, -1 where the list
    was not asked; None if it was asked for none.
    """

    group_ids: Int32Array
    transforms: Float32Array
    bad_rows: Int32Array
    ids: Int32Array
    expand_ids: Callable[[Int32Array, Int32Array], Int32Array]
    is_plain: bool = False
    random_ids: npt.NDArray[np.int64] | None = None


def list_instances(depsgraph: Any, groups: GroupTable) -> Listing:
    """Blender's list: every kind of instance, at a Python object for each."""
    instances = depsgraph.object_instances
    finder = GroupFinder(groups)
    found, found_strands = _find_groups(instances, finder)
    group_ids = np.array(found, np.int32)
    count = len(group_ids)
    matrices = np.empty((count, 4, 4), np.float32)
    persistent_ids = np.empty((count, 8), np.int32)
    instances.foreach_get("matrix_world", matrices.reshape(-1))
    instances.foreach_get("persistent_id", persistent_ids.reshape(-1))
    transforms = np.empty((count, 3, 4), np.float32)
    bad_rows = place_instances(None, matrices, transforms, LARGEST_COORDINATE)
    is_plain = finder.saw_only_objects
    random_ids = None
    if not is_plain and RANDOM in groups.materials.sources:
        read = np.empty(count, np.int32)
        instances.foreach_get("random_id", read)
        random_ids = read.view(np.uint32).astype(np.int64)
    listing = Listing(group_ids, transforms, bad_rows, persistent_ids, lambda _, ids: ids, is_plain, random_ids)
    if not found_strands:
        return listing
    strands = np.full(count, NOT_SHOWN, np.int32)
    strands[list(found_strands)] = list(found_strands.values())
    return _with_strands(listing, strands)


def _find_groups(instances: Any, finder: GroupFinder) -> tuple[list[int], dict[int, int]]:
    """The group of each, and those of strands by row: asked for in the order of `ListWalk`, which is that of meshes."""
    groups, strands = [], {}
    for row, instance in enumerate(instances):
        groups.append(finder.find(instance))
        if finder.saw_strands:
            group = finder.find_strands(instance)
            if group != NOT_SHOWN:
                strands[row] = group
    return groups, strands


def _with_strands(listing: Listing, strands: Int32Array) -> Listing:
    """Adds instances of strands, each right after its own object's instance.

    strands: (N,) int32, their groups, or NOT_SHOWN.
    """
    beside = np.flatnonzero(strands != NOT_SHOWN)
    if not len(beside):
        return listing
    rows = np.insert(np.arange(len(strands)), beside + 1, beside)
    group_ids = np.insert(listing.group_ids, beside + 1, strands[beside])
    is_bad = np.zeros(len(strands), np.bool_)
    is_bad[listing.bad_rows] = True
    return replace(
        listing,
        group_ids=group_ids,
        transforms=listing.transforms[rows],
        bad_rows=np.flatnonzero(is_bad[rows]).astype(np.int32),
        ids=listing.ids[rows],
        is_plain=False,
        random_ids=None if listing.random_ids is None else listing.random_ids[rows],
    )


class GroupFinder:
    """The group of each instance of Blender's list.

    Nothing of an instance may be kept: the object of a duplicate is one temporary that is overwritten. Its mesh,
    the object it is a duplicate of, and its instancer do last for the loop; they are compared by address, and
    as dictionary keys at half the cost of asking for their addresses.
    """

    def __init__(self, groups: GroupTable) -> None:
        self._groups = groups
        self._known: dict[Any, int] = {}
        self._known_strands: dict[Any, int] = {}
        self.saw_strands = False  # some instance has particle systems that may show strands
        self.saw_only_objects = True  # none of the instances was made by another object

    def find(self, instance: Any, numbering: int = 0) -> int:
        """Returns an instance's row, or NOT_SHOWN; the numbering is that of a new group."""
        source = instance.instance_object
        if source is not None:
            self.saw_only_objects = False
        obj = instance.object
        data = obj.data
        if data is None:
            return NOT_SHOWN
        if not instance.show_self:  # only objects with strands are shown without their surface
            self.saw_strands = self.saw_strands or has_strands(obj)
            return NOT_SHOWN
        token = obj if source is None else (data, source, instance.parent)
        group = self._known.get(token)
        if group is None:
            group = self._known[token] = self._groups.add(
                obj,
                data,
                parent=None if source is None else instance.parent,
                is_own=source is None or source.data == data,
                numbering=numbering,
            )
            self.saw_strands = self.saw_strands or has_strands(obj)
        return group

    def find_strands(self, instance: Any, numbering: int = 0) -> int:
        """The row of the strands that an instance shows in addition to its surface, or NOT_SHOWN."""
        obj, source = instance.object, instance.instance_object
        if not instance.show_particles or obj.data is None or not len(obj.particle_systems):
            return NOT_SHOWN
        if source is not None and source.data != obj.data:  # an additional result of geometry nodes
            return NOT_SHOWN
        token = obj if source is None else (source, instance.parent)
        group = self._known_strands.get(token)
        if group is None:
            parent = None if source is None else instance.parent
            group = self._groups.add_strands(obj, source or obj, parent=parent, numbering=numbering)
            self._known_strands[token] = group
        return group


@dataclass(slots=True)
class ListedPart:
    """An object's own entry and those of its instances. matrices: (4, 4) each, in rows."""

    group_ids: list[int] = field(default_factory=list)
    matrices: list[Any] = field(default_factory=list)
    persistent_ids: list[Any] = field(default_factory=list)
    random_ids: list[int] = field(default_factory=list)

    @property
    def columns(self) -> tuple[Float32Array, Int32Array, Int32Array, npt.NDArray[np.int64]]:
        """(N, 4, 4) float32 matrices in columns, (N,) int32 group ids, (N, 8) int32 persistent ids, (N,) random ids."""
        count = len(self.group_ids)
        matrices = np.array(self.matrices, np.float32).reshape(count, 4, 4)
        persistent_ids = np.array(self.persistent_ids, np.int32).reshape(count, _LEVELS)
        random_ids = np.array(self.random_ids, np.int64) & 0xFFFFFFFF
        matrices = np.ascontiguousarray(matrices.transpose(0, 2, 1))
        return matrices, np.array(self.group_ids, np.int32), persistent_ids, random_ids


class ListWalk:
    """Goes through the list once. Objects must be asked for in the order in which the depsgraph has them."""

    def __init__(self, depsgraph: Any, finder: GroupFinder, numbering: int) -> None:
        self._items = iter(depsgraph.object_instances)
        self._item = next(self._items, None)
        self._finder = finder
        self._numbering = numbering

    def read(self, obj: Any) -> ListedPart:
        """Reads the entries of an evaluated object; skips entries before them."""
        while self._item is not None and (self._item.is_instance or self._item.object != obj):
            self._item = next(self._items, None)
        if self._item is None:
            raise RuntimeError(f"{obj.name}: not in the depsgraph's list of instances, or at another position there")
        part = ListedPart()
        while self._item is not None and (not part.group_ids or self._belongs_to(obj)):
            self._read_item(part)
        return part

    def read_hidden(self, instancers: list[Any], following: Any) -> ListedPart:
        """Reads the instances of instancers without entries of their own, which come before that of `following`.

        instancers: evaluated; they may have none. following: the object after them, None at the end.
        """
        part = ListedPart()
        while self._item is not None and (self._item.is_instance or self._item.object != following):
            if self._item.is_instance and self._item.parent in instancers:
                self._read_item(part)
            else:
                self._item = next(self._items, None)
        return part

    def _read_item(self, part: ListedPart) -> None:
        self._add(part, self._finder.find(self._item, self._numbering))
        strands = self._finder.find_strands(self._item, self._numbering)
        if strands != NOT_SHOWN:
            self._add(part, strands)
        self._item = next(self._items, None)

    def _add(self, part: ListedPart, group: int) -> None:
        """Copies: an entry is overwritten by the next one."""
        part.group_ids.append(group)
        part.matrices.append(np.array(self._item.matrix_world, np.float32))
        part.persistent_ids.append(tuple(self._item.persistent_id))
        part.random_ids.append(self._item.random_id)

    def _belongs_to(self, obj: Any) -> bool:
        return self._item.is_instance and self._item.parent == obj
