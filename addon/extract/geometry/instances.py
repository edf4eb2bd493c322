"""Everything that the depsgraph shows -> columns of instances."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from perfect_bvh.bulk import are_equal

from ...sync.records import InstanceRecords, Int32Array
from ..pointer_views import ArrayReader
from .geometry_instances import list_geometry_instances
from .groups import NOT_SHOWN, GroupTable
from .listing import Listing, list_instances

_OF_MATRICES = "Clear or mend the object's transform, or look what drives it or its instances"


@dataclass(slots=True)
class InstanceCache:
    """What the last reading found, so that the next can tell that only transforms are new.

    shown: (N,) bool, which of the evaluated objects the instances are; None if there are other instances.
    random_ids: of the instances, see `Listing`.
    """

    groups: npt.NDArray[np.int64] | None = None
    group_ids: Int32Array | None = None
    ids: Int32Array | None = None
    records: InstanceRecords | None = None
    shown: npt.NDArray[np.bool_] | None = None
    random_ids: npt.NDArray[np.int64] | None = None


def read_instances(depsgraph: Any, groups: GroupTable, reader: ArrayReader, cache: InstanceCache) -> InstanceRecords:
    """All visible instances that have triangles, in the depsgraph's own order."""
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
    """(N,) bool: what is shown and has a matrix that is of use."""
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
