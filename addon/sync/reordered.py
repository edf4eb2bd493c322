"""Finds instances without ids that changed their order from one moment to another.

Blender numbers them by their order. If that changes, each number is at another instance's place, and a motion from the
one to the other would lead through places where nothing ever was.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .keys import Uint64Array, mix
from .moments import MatchedMoment
from .records import BoolArray, Float32Array, InstanceRecords, SceneRecord

IntArray = npt.NDArray[np.intp]


def find_reordered(record: SceneRecord, at: list[MatchedMoment], asked: BoolArray) -> BoolArray:
    """Finds instances whose pairs are not to be trusted.

    Those are all that move, two or more, of the instances that one instancer makes of one object, if their numbers are
    their order, and each moves exactly to where one of them is at the frame.

    Args:
        record: the scene at the frame.
        at: the moments.
        asked: (I,) bool, instances that are there at all of them.

    Returns:
        (I,) bool.
    """
    instances = record.instances
    moved = asked & (instances.parent_indices >= 0) & np.logical_or.reduce([moment.moved for moment in at])
    found = np.zeros(len(moved), np.bool_)
    if np.count_nonzero(moved) < 2:
        return found
    pairs = instances.parent_indices.astype(np.int64) * len(record.objects) + instances.object_indices
    rows = np.flatnonzero(np.isin(pairs, pairs[moved]))
    groups = np.unique(pairs[rows], return_inverse=True)[1].reshape(-1)
    is_taken = moved[rows]
    places = _places(instances.transforms[rows], groups)
    for moment in at:
        there = np.flatnonzero(is_taken)
        transforms = moment.moment.instances.transforms[moment.rows[rows[there]]]
        is_taken[there] = np.isin(_places(transforms, groups[there]), places)
    taken, all_moved = (np.bincount(groups[each], minlength=groups.max() + 1) for each in (is_taken, moved[rows]))
    is_suspect = (taken >= 2) & (taken == all_moved)
    if is_suspect.any():  # else what follows, which sorts, is not needed
        is_suspect &= _are_in_order(instances, at, rows, groups)
        found[rows] = moved[rows] & is_suspect[groups]
    return found


def _places(transforms: Float32Array, groups: IntArray) -> Uint64Array:
    """(N,) uint64 that tell places of each group apart."""
    columns: Any = (transforms + np.float32(0.0)).reshape(-1, 12).view(np.uint32)  # -0 is 0
    keys = groups.astype(np.uint64)
    for column in columns.T:
        keys = mix(keys ^ column.astype(np.uint64))
    return keys


def _are_in_order(instances: InstanceRecords, at: list[MatchedMoment], rows: IntArray, groups: IntArray) -> BoolArray:
    """(G,) bool: whether the instances of each group come in the order of their numbers, at the frame and at `at`."""
    by_group = np.argsort(groups, kind="stable")
    numbers = instances.persistent_ids[rows].T  # outer levels come last
    is_out = by_group != np.lexsort((*numbers, groups))
    for moment in at:
        listed = moment.rows[rows[by_group]]
        is_out[1:] |= (np.diff(listed) < 0) & (np.diff(groups[by_group]) == 0) & (listed[1:] >= 0)
    return np.asarray(np.bincount(groups[by_group], is_out, minlength=groups.max() + 1) == 0)
