"""Who an instance is: numbers that name it across evaluations, and the order in which instances win ties.

Both are pure functions of the records, so a scene that was synced over many frames and one that was read
afresh give the same names and break ties alike.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from .records import InstanceRecords, Int32Array, ObjectRecord

Uint64Array = npt.NDArray[np.uint64]
Int64Array = npt.NDArray[np.int64]

_PERSISTENT_ID_LEVELS = 8
UNUSED_LEVEL = 2**31 - 1  # Blender's filler in the levels of a persistent id that are not used


class PlacedInstances(Protocol):
    """A scene, or a moment of it."""

    @property
    def instances(self) -> InstanceRecords: ...
    @property
    def objects(self) -> tuple[ObjectRecord, ...]: ...


def instance_keys(record: PlacedInstances) -> Uint64Array:
    """(I,) uint64, distinct: a 64-bit mix of the object's and the instancer's session uid and the persistent id.

    Indistinguishable instances are numbered in order. If two different instances ever get
    the same key, one counts as a change of the other: everything about an instance is compared as well.
    """
    return number_repeated(plain_keys(record))


def plain_keys(record: PlacedInstances) -> Uint64Array:
    """Returns (I,) uint64: like `instance_keys`, but indistinguishable instances share a key."""
    instances = record.instances
    keys = np.zeros(len(instances), np.uint64)
    for column in (*_uids(record), *instances.persistent_ids.T):
        keys = mix(keys ^ column.astype(np.uint32).astype(np.uint64))
    return keys


def instance_orders(record: PlacedInstances) -> Int64Array:
    """(I,) int64, distinct: of hits at the same t, that of the instance with the smallest order wins.

    Sorted by the object's uid, the instancer's uid, then the persistent id, of which a part is kept; instances that
    this part does not distinguish get adjacent numbers, by all of it, else in the order they come. Uids differ
    from session to session but their order, that of loading and creating, does not; so the same file gives the same
    image.
    """
    packed = _packed_orders(record)
    if (packed[1:] > packed[:-1]).all():
        return packed
    by_order = np.argsort(packed)
    ordered = packed[by_order]
    is_repeated = ordered[1:] == ordered[:-1]
    if not is_repeated.any():
        return packed
    is_shared = np.zeros(len(packed), np.bool_)
    is_shared[1:] = is_repeated
    is_shared[:-1] |= is_repeated
    rows = np.sort(by_order[is_shared])
    objects, parents = _uids(record)
    columns = [column[rows] for column in (*reversed(record.instances.persistent_ids.T), parents, objects)]
    varied = [column for column in columns if (column != column[0]).any()]
    by_order[is_shared] = rows[np.lexsort([*varied, packed[rows]])]
    # Each at least one more than the one before.
    steps = np.arange(len(packed))
    orders = np.empty_like(packed)
    orders[by_order] = np.maximum.accumulate(ordered - steps) + steps
    return orders


def _packed_orders(record: PlacedInstances) -> Int64Array:
    """(I,) int64: 22 bits of the object's uid, 20 of the instancer's, 21 of the persistent id's levels, mixed."""
    objects, parents = (column.astype(np.uint64) for column in _uids(record))
    place = np.zeros(len(record.instances), np.uint64)
    for level in reversed(range(_PERSISTENT_ID_LEVELS)):
        column = record.instances.persistent_ids[:, level]
        if (column == UNUSED_LEVEL).all() and not place.any():
            continue
        used = np.where(column == UNUSED_LEVEL, 0, column)
        place = place * np.uint64(40503) + used.astype(np.uint32)
    packed = ((objects & np.uint64(0x3FFFFF)) << np.uint64(41)) | ((parents & np.uint64(0xFFFFF)) << np.uint64(21))
    orders: Int64Array = (packed | (place & np.uint64(0x1FFFFF))).astype(np.int64)
    return orders


def _uids(record: PlacedInstances) -> tuple[Int64Array, Int64Array]:
    """Session uids of each instance's object and of its instancer, 0 for none."""
    uids = np.array([*(obj.session_uid for obj in record.objects), 0], np.int64)
    return uids[record.instances.object_indices], uids[record.instances.parent_indices]


def mix(values: Uint64Array) -> Uint64Array:
    """One round of the splitmix64 generator (Steele, Lea and Flood 2014): a bijection that spreads every bit."""
    values = values + np.uint64(0x9E3779B97F4A7C15)
    values = (values ^ (values >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    values = (values ^ (values >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return values ^ (values >> np.uint64(31))


def number_repeated(keys: Uint64Array) -> Uint64Array:
    """Gives the second, third ... of equal keys other, distinct keys."""
    while True:
        by_key = np.argsort(keys, kind="stable")
        ordered = keys[by_key]
        is_repeated = np.zeros(len(keys), np.bool_)
        is_repeated[1:] = ordered[1:] == ordered[:-1]
        if not is_repeated.any():
            return keys
        positions = np.arange(len(keys))
        starts = np.maximum.accumulate(np.where(is_repeated, 0, positions))
        numbers = (positions - starts).astype(np.uint64)
        keys = keys.copy()
        keys[by_key[is_repeated]] = mix(ordered[is_repeated] + numbers[is_repeated])


def match_keys(old: npt.NDArray[Any], new: npt.NDArray[Any]) -> Int32Array:
    """(N,) int32: the row of `old` that holds each key of `new`, -1 if none does. Keys are distinct on either side."""
    if len(old) == len(new) and np.array_equal(old, new):
        return np.arange(len(new), dtype=np.int32)
    if len(old) == 0:
        return np.full(len(new), -1, np.int32)
    by_key = np.argsort(old)
    places = np.minimum(np.searchsorted(old, new, sorter=by_key), len(old) - 1)
    rows = by_key[places]
    return np.where(old[rows] == new, rows, -1).astype(np.int32)
