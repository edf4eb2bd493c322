"""Instances made by geometry nodes, a whole instancer at a time: no Python object for each (Blender 4.5 and later).

Each instancer's geometry contains its references and transforms, as arrays. Objects that it does not describe fully
are read from Blender's list, and only those: see `instancer_survey.py`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from perfect_bvh.bulk import are_equal, place_instances

from ...sync.records import LARGEST_COORDINATE, Float32Array, InstanceRecords, Int32Array
from ..pointer_views import MATRICES, REFERENCE_INDICES, ArrayReader
from .groups import NOT_SHOWN, GroupTable
from .instancer_survey import LISTED, Instancer, Shown, Survey, survey
from .listing import GroupFinder, Listing, ListWalk, list_instances

_UNUSED_LEVEL = 2**31 - 1  # Blender's filler in a persistent id
_LEVELS = 8

# Blender's numbering of the instances of a group: plain objects have none; others have the instance's id, after as many
# zeros as there are geometries between: an object has none, a mesh that is a reference's own geometry has one. For
# instances from the list, the numbers were read as well.
_PLAIN = -1
_READ = -2


@dataclass(slots=True)
class _Block:
    """Consecutive instances of one instancer, or plain objects.

    parent, local: (4, 4) and (N, 4, 4) float32, the latter a view that is transposed; for plain objects parent is None.
    ids: (N,) int32, or (N, 8) for whole persistent ids. random_ids: (N,), where they were read. inner: rows, and the
    matrices that follow for them.
    """

    parent: Float32Array | None
    local: Float32Array
    group_ids: Int32Array
    ids: Int32Array
    random_ids: npt.NDArray[np.int64] | None = None
    inner: list[tuple[npt.NDArray[np.intp], list[Float32Array]]] = field(default_factory=list)


def list_geometry_instances(depsgraph: Any, groups: GroupTable, reader: ArrayReader) -> Listing | None:
    """Returns the same as `list_instances`, or None, with nothing read, if only that is possible."""
    surveyed = survey(depsgraph)
    return None if surveyed is None else _Collector(groups, reader).collect(depsgraph, surveyed)


class _Collector:
    """Turns the surveyed instances into columns."""

    def __init__(self, groups: GroupTable, reader: ArrayReader) -> None:
        self._groups = groups
        self._reader = reader
        self._blocks: list[_Block] = []

    def collect(self, depsgraph: Any, surveyed: Survey) -> Listing:
        matrices = np.empty((len(surveyed.objects), 4, 4), np.float32)
        depsgraph.objects.foreach_get("matrix_world", matrices.reshape(-1))
        walk: ListWalk | None = None
        plain_from = 0
        plain: list[int] = []

        def add_hidden(row: int, following: Any) -> None:
            nonlocal walk
            walk = walk or ListWalk(depsgraph, GroupFinder(self._groups), _READ)
            part = walk.read_hidden(surveyed.hidden[row], following)
            self._blocks.append(_Block(None, *part.columns))

        for row, (obj, found) in enumerate(surveyed.objects):
            if row in surveyed.hidden:
                self._add_plain(matrices[plain_from:row], plain)
                plain_from, plain = row, []
                add_hidden(row, obj)
            if found is None:
                plain.append(self._add_own(obj))
                continue
            if found is LISTED:
                self._add_plain(matrices[plain_from:row], plain)
                walk = walk or ListWalk(depsgraph, GroupFinder(self._groups), _READ)
                self._blocks.append(_Block(None, *walk.read(obj).columns))
            else:
                plain.append(self._add_own(obj))
                self._add_plain(matrices[plain_from : row + 1], plain)
                self._add_instances(obj, matrices[row], found)
            plain_from, plain = row + 1, []
        self._add_plain(matrices[plain_from:], plain)
        if len(surveyed.objects) in surveyed.hidden:
            add_hidden(len(surveyed.objects), None)
        return self._join(is_read=walk is not None)

    def _add_own(self, obj: Any) -> int:
        """The group of an object that is shown as itself."""
        data = obj.data
        return NOT_SHOWN if data is None else self._groups.add(obj, data, parent=None, is_own=True, numbering=_PLAIN)

    def _add_plain(self, matrices: Float32Array, group_ids: list[int]) -> None:
        """Leaves out at once what shows nothing, which an instancer mostly does: the others need no copying later."""
        groups = np.array(group_ids, np.int32)
        shown = groups != NOT_SHOWN
        self._blocks.append(_Block(None, matrices[shown], groups[shown], np.zeros(shown.sum(), np.int32)))

    def _add_instances(self, obj: Any, matrix: Float32Array, instancer: Instancer) -> None:
        if instancer.points is None:
            groups = np.array([self._add_shown(obj, shown) for shown in instancer.references if shown], np.int32)
            self._blocks.append(_Block(None, matrix[None], groups, np.zeros(1, np.int32)))
            return
        attributes = instancer.points.attributes
        local = self._reader.view(attributes["instance_transform"].data, MATRICES).reshape(-1, 4, 4)
        references = self._reader.view(attributes[".reference_index"].data, REFERENCE_INDICES)
        own_ids = attributes.get("id")
        if own_ids is None:
            ids = np.arange(len(local), dtype=np.int32)
        else:
            ids = self._reader.read(own_ids.data, REFERENCE_INDICES)
        groups = np.full(len(instancer.references), NOT_SHOWN, np.int32)
        block = _Block(matrix.T, local, groups, ids)
        for index in _in_order_of_use(references, len(groups)):
            shown = instancer.references[index]
            if shown is None:
                continue
            groups[index] = self._add_shown(obj, shown)
            if shown.matrices:
                block.inner.append((np.flatnonzero(references == index), shown.matrices))
        block.group_ids = np.take(groups, references)
        self._blocks.append(block)

    def _add_shown(self, instancer: Any, shown: Shown) -> int:
        obj = shown.obj or instancer
        is_own = shown.obj is not None
        return self._groups.add(obj, shown.mesh, parent=instancer, is_own=is_own, numbering=shown.zeros)

    def _join(self, *, is_read: bool) -> Listing:
        """Joins the blocks. is_read: whether some persistent ids were read: then all are made now, for one table."""
        counts = [len(block.local) for block in self._blocks]
        transforms = np.empty((sum(counts), 3, 4), np.float32)
        bad_rows = []
        first = 0
        for block, count in zip(self._blocks, counts, strict=True):
            placed = transforms[first : first + count]
            bad = place_instances(block.parent, block.local, placed, LARGEST_COORDINATE)
            for rows, matrices in block.inner:
                placed[rows] = _place_within(placed[rows], matrices)
            if block.inner:
                bad = np.flatnonzero(~(np.abs(placed) <= LARGEST_COORDINATE).all(axis=(1, 2)))
            bad_rows.append(bad + first)
            first += count
        ids = [self._whole_ids(block) if is_read else block.ids for block in self._blocks]
        return Listing(
            group_ids=_joined([block.group_ids for block in self._blocks]),
            transforms=transforms,
            bad_rows=np.concatenate(bad_rows).astype(np.int32),
            ids=_joined(ids),
            expand_ids=(lambda _, whole: whole) if is_read else self._expand_ids,
            random_ids=np.concatenate([_random_ids(block) for block in self._blocks]) if is_read else None,
        )

    def _whole_ids(self, block: _Block) -> Int32Array:
        return block.ids if block.ids.ndim == 2 else self._expand_ids(block.group_ids, block.ids)

    def _expand_ids(self, group_ids: Int32Array, ids: Int32Array) -> Int32Array:
        """(I, 8) persistent ids in Blender's numbering; meaningless for instances that are not shown."""
        zeros = np.array([*(row[-1] for row in self._groups.rows), _READ], np.int8)[group_ids]  # the last: not shown
        expanded = np.full((len(ids), _LEVELS), _UNUSED_LEVEL, np.int32)
        for count in np.unique(zeros):
            rows = zeros == count
            if count == _PLAIN:
                expanded[rows] = 0
            elif count >= 0:
                expanded[rows, :count] = 0
                expanded[rows, count] = ids[rows]
        return expanded


def _random_ids(block: _Block) -> npt.NDArray[np.int64]:
    """Returns Blender's random numbers, -1 where they were not read."""
    return np.full(len(block.local), -1, np.int64) if block.random_ids is None else block.random_ids


def _joined(arrays: list[Int32Array]) -> Int32Array:
    """One after the other; of arrays that are all empty but one, that one."""
    filled = [array for array in arrays if len(array)]
    return filled[0] if len(filled) == 1 else np.concatenate(arrays)


def _place_within(outer: Float32Array, matrices: list[Float32Array]) -> Float32Array:
    """(N, 3, 4): outer maps times the matrices, one after the other, summed in Blender's order."""
    for m in matrices:
        x, y, z, w = (outer[:, :, column, None] for column in range(4))
        outer = (x * m[0] + y * m[1]) + (z * m[2] + w * m[3])
    return outer


def _in_order_of_use(references: npt.NDArray[np.int32], count: int) -> Iterator[int]:
    """The references that are used, in the order in which Blender's list would come to them."""
    if count == 1:
        return iter((0,))
    used, first = np.unique(references, return_index=True)
    return iter(int(reference) for reference in used[np.argsort(first)])


# Instances -----------------------------------------------------------------------------------------------------------
# Everything that the depsgraph shows -> columns of instances.


_OF_MATRICES = "Clear or correct the object's transform, or check what drives it or its instances"


@dataclass(slots=True)
class InstanceCache:
    """The results of the last reading, so that the next can find out that only transforms have changed.

    shown: (N,) bool, the evaluated objects that the instances are; None if there are other instances.
    random_ids: of the instances, see `Listing`.
    """

    groups: npt.NDArray[np.int64] | None = None
    group_ids: Int32Array | None = None
    ids: Int32Array | None = None
    records: InstanceRecords | None = None
    shown: npt.NDArray[np.bool_] | None = None
    random_ids: npt.NDArray[np.int64] | None = None


def read_instances(depsgraph: Any, groups: GroupTable, reader: ArrayReader, cache: InstanceCache) -> InstanceRecords:
    """Reads all visible instances that have triangles, in the depsgraph's own order."""
    listing = list_geometry_instances(depsgraph, groups, reader) if reader.use_views else None
    if listing is None:
        listing = list_instances(depsgraph, groups)
    shown = _find_shown(listing, groups)
    cache.shown = shown if listing.is_plain else None
    listing = _only(listing, shown)
    cache.random_ids = listing.random_ids
    rows = np.array(groups.rows, np.int64).reshape(-1, 5)
    if cache.records is not None and _is_same(cache, rows, listing):
        cache.records = replace(cache.records, transforms=listing.transforms)
        return cache.records
    columns = rows.astype(np.int32).T.copy()
    group_ids = listing.group_ids
    records = InstanceRecords(
        mesh_indices=columns[0][group_ids],
        object_indices=columns[1][group_ids],
        parent_indices=columns[2][group_ids],
        transforms=listing.transforms,
        masks=rows[:, 3].astype(np.uint32)[group_ids],
        persistent_ids=listing.expand_ids(group_ids, listing.ids),
    )
    cache.groups, cache.group_ids, cache.ids, cache.records = rows, group_ids, listing.ids, records
    return records


def _is_same(cache: InstanceCache, rows: npt.NDArray[np.int64], listing: Listing) -> bool:
    pairs = ((cache.groups, rows), (cache.group_ids, listing.group_ids), (cache.ids, listing.ids))
    return all(old is not None and are_equal(old, new) for old, new in pairs)


def _find_shown(listing: Listing, groups: GroupTable) -> npt.NDArray[np.bool_]:
    """(N,) bool: the instances that are shown and have a valid matrix."""
    shown = listing.group_ids != NOT_SHOWN
    bad = listing.bad_rows[shown[listing.bad_rows]]
    for group, count in zip(*np.unique(listing.group_ids[bad], return_counts=True), strict=True):
        text = f"left out {count:,} instance{'s' * int(count > 1)} with a matrix that is not finite or beyond 1e18"
        groups.warn_of(int(group), text, _OF_MATRICES)
    shown[bad] = False
    return shown


def _only(listing: Listing, shown: npt.NDArray[np.bool_]) -> Listing:
    if shown.all():
        return listing
    return replace(
        listing,
        group_ids=listing.group_ids[shown],
        transforms=listing.transforms[shown],
        ids=listing.ids[shown],
        random_ids=None if listing.random_ids is None else listing.random_ids[shown],
    )
