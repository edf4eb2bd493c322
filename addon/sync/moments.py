"""The scene at other time samples of the shutter: matches each instance, and compares its mesh.

Instances are matched by their keys, and their meshes with them: an evaluated mesh has no better identification than
its instances. Identical arrays are known to be equal, so static meshes cost almost nothing.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt
from perfect_bvh.bulk import find_moved

from .compare import are_same_instances, have_same, topology_change
from .keys import Uint64Array, match_keys, mix, number_repeated, plain_keys
from .plan import RADIUS_ROUNDING
from .records import (
    BoolArray,
    CameraRecord,
    Float32Array,
    InstanceRecords,
    Int32Array,
    MeshRecord,
    ObjectRecord,
    SceneRecord,
)

Int8Array = npt.NDArray[np.int8]

# What became of a shape. REMADE: its triangles, curves or points are others. BARE: some of its points have a radius
# now and none then, which no motion leads to.
SAME, DEFORMED, REMADE, BARE = range(4)


@dataclass(frozen=True, slots=True, eq=False)
class MomentRecord:
    """The scene at one time sample of the shutter: positions, without looks.

    The fields are those of a `SceneRecord`. complaint: why there is no camera, as a sentence.
    """

    meshes: tuple[MeshRecord, ...]
    objects: tuple[ObjectRecord, ...]
    instances: InstanceRecords
    camera: CameraRecord | None = None
    complaint: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class MotionSettings:
    """The users' settings for the motion of each of a scene's objects, and of its camera.

    steps: (O,) int32, the number of time samples of an object, 0 if it must not move. deforms: (O,) bool,
    whether its shape may change in between. camera_steps: as steps. camera_name, camera_uid: of the object, if any.
    """

    steps: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    deforms: BoolArray = field(default_factory=lambda: np.empty(0, np.bool_))
    camera_steps: int = 0
    camera_name: str = ""
    camera_uid: int = 0

    @property
    def times(self) -> list[Fraction]:
        """Returns all time samples that are needed, in order: a union of grids."""
        counts = {int(count) for count in self.steps} | {self.camera_steps}
        return sorted({time for count in counts if count for time in times_of(count)})

    def limited_to(self, times: Container[Fraction]) -> MotionSettings:
        """Returns the same settings, but objects that need other time samples than these do not move."""
        steps = self.steps.copy()
        for count in np.unique(steps[steps > 0]).tolist():
            if not all(time in times for time in times_of(count)):
                steps[steps == count] = 0
        return replace(self, steps=steps)


def times_of(steps: int) -> list[Fraction]:
    """Returns `steps` time samples, 2 or more, at equal intervals."""
    return [Fraction(step, steps - 1) for step in range(steps)]


@dataclass(frozen=True, slots=True)
class MatchedMoment:
    """The I instances of a scene at one moment.

    rows: (I,) int32, of the same instance at the moment, -1 if it is not there. moved: (I,) bool. shapes: (I,) int8,
    what became of the mesh that it shows; SAME where it is not there. new_rows: of instances that the scene lacks.
    """

    moment: MomentRecord
    rows: Int32Array
    moved: BoolArray
    shapes: Int8Array
    new_rows: Int32Array

    def mesh_rows(self, instances: npt.NDArray[np.intp]) -> Int32Array:
        """Rows of the moment's meshes that these instances show, which all are there."""
        return np.asarray(self.moment.instances.mesh_indices[self.rows[instances]])


class MomentMatcher:
    """Matches moments with one record of the scene."""

    def __init__(self, record: SceneRecord) -> None:
        self._record = record
        self._plain: Uint64Array | None = None
        self._keys: Uint64Array | None = None

    def match(self, moment: MomentRecord) -> MatchedMoment:
        """Matches the record's instances at a time sample."""
        here, there = self._record.instances, moment.instances
        new_rows = np.empty(0, np.int32)
        if are_same_instances(here, self._record.objects, moment):
            rows = np.arange(len(here), dtype=np.int32)
        else:
            rows, new_rows = self._match_keys(moment)
        moved = find_moved(there.transforms, here.transforms, rows)
        return MatchedMoment(moment, rows, moved, self._shapes(moment, rows), new_rows)

    def _match_keys(self, moment: MomentRecord) -> tuple[Int32Array, Int32Array]:
        """(I,) rows of the moment's instances, -1 for none, and rows of those that the record lacks."""
        if self._plain is None or self._keys is None:
            self._plain = plain_keys(self._record)
            self._keys = number_repeated(self._plain)
        plain = plain_keys(moment)
        keys = number_repeated(plain)
        rows = match_keys(keys, self._keys)
        new_rows = np.empty(0, np.int32)
        if len(keys) != len(rows) or (rows < 0).any():
            new_rows = np.flatnonzero(match_keys(self._keys, keys) < 0).astype(np.int32)
            rows[_are_more_or_less(self._plain, plain)] = -1
        return rows, new_rows

    def _shapes(self, moment: MomentRecord, rows: Int32Array) -> Int8Array:
        shapes = np.zeros(len(rows), np.int8)
        meshes, others = self._record.meshes, moment.meshes
        found = np.flatnonzero(rows >= 0)
        if not len(found):
            return shapes
        shown = self._record.instances.mesh_indices[found].astype(np.int64)
        pairs = shown * len(others) + moment.instances.mesh_indices[rows[found]]
        if (pairs == pairs[0]).all():  # a forest of one tree, or a single object
            shapes[found] = compare_shapes(*_pair(meshes, others, int(pairs[0])))
            return shapes
        used = np.zeros(len(meshes) * len(others), np.bool_) if len(meshes) * len(others) < 1 << 24 else None
        if used is None:
            different, places = np.unique(pairs, return_inverse=True)
        else:  # by a table, which takes a fraction of the time of sorting
            used[pairs] = True
            different = np.flatnonzero(used)
            places = (np.cumsum(used) - 1)[pairs]
        verdicts = [compare_shapes(*_pair(meshes, others, int(pair))) for pair in different]
        shapes[found] = np.array(verdicts, np.int8)[places]
        return shapes


def compare_shapes(here: MeshRecord, there: MeshRecord) -> int:
    """Classifies a mesh's change at another time sample: SAME, DEFORMED, REMADE or BARE."""
    if topology_change(here, there):
        return REMADE
    if have_same(here, there, "positions", "radii") or _differ_by_rounding(here, there):
        return SAME
    if here.radii is not None and there.radii is not None and ((here.radii == 0.0) != (there.radii == 0.0)).any():
        return BARE
    return DEFORMED


def _differ_by_rounding(here: MeshRecord, there: MeshRecord) -> bool:
    """Whether they differ only by rounding: strands are in the world, but are read in their object's space."""
    rounding = max(here.rounding, there.rounding)
    if rounding == 0.0 or here.radii is None or there.radii is None:
        return False
    widest = float(here.radii.max(initial=0.0))
    return bool(
        (np.abs(here.positions - there.positions) <= rounding).all()
        and (np.abs(here.radii - there.radii) <= RADIUS_ROUNDING * widest).all()
    )


def _are_more_or_less(keys: Uint64Array, others: Uint64Array) -> BoolArray:
    """(I,) bool: of a key that several instances have, and more or less of them at the moment: which is which?"""
    known, places, counts = np.unique(keys, return_inverse=True, return_counts=True)
    found, other_counts = np.unique(others, return_counts=True)
    there = np.zeros(len(known), np.int64)
    at = np.minimum(np.searchsorted(found, known), max(len(found) - 1, 0))
    if len(found):
        there = np.where(found[at] == known, other_counts[at], 0)
    unsure = (np.maximum(counts, there) > 1) & (counts != there)
    return np.asarray(unsure[places.reshape(-1)])


def _pair(meshes: tuple[MeshRecord, ...], others: tuple[MeshRecord, ...], pair: int) -> tuple[MeshRecord, MeshRecord]:
    row, other = divmod(pair, len(others))
    return meshes[row], others[other]


# Reordered -----------------------------------------------------------------------------------------------------------
# Finds instances without ids that changed their order from one moment to another.
#
# Blender numbers them by their order. If that changes, each number is at another instance's place, and a motion from
# the one to the other would lead through places where nothing ever was.


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
