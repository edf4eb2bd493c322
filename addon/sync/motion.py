"""From a scene at several time samples of the shutter to the motions that the engine is given.

Objects that are the same at all of their samples get no motion. Some objects cannot be followed: they do not exist at
one sample, have other triangles there, or may be another instance. They do not move, and are listed once.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from .compare import is_same_camera
from .keys import PlacedInstances
from .moments import (
    BARE,
    DEFORMED,
    REMADE,
    MatchedMoment,
    MomentMatcher,
    MomentRecord,
    MotionSettings,
    find_reordered,
    times_of,
)
from .not_shown import NotShown
from .records import (
    BoolArray,
    CameraRecord,
    Float32Array,
    InstanceMotions,
    Int32Array,
    MeshMotion,
    MeshRecord,
    ObjectRecord,
    SceneMotion,
    SceneRecord,
)

# Objects that do not move within a shutter although they should: a row of `not_shown` for each, in words.


_OF_MISSING = "Bake it, or let it begin or end at a whole frame; or turn its Motion Blur off"
_OF_ORDER = "Give the points ids, by Set ID, before nodes change their order; or turn its Motion Blur off"
_OF_SHAPES = "Keep its number of points the same from frame to frame, or turn its Deformation motion blur off"
_OF_FLAT = "Scale it to a small number instead of zero, or turn its Motion Blur off"
_OF_CAMERA = "Keep the camera's type and scale usable throughout the shutter, or turn its Motion Blur off"
# Nothing of it moves; or everything but its materials.
_STILL = "it stands still, as at the frame"

IntArray = npt.NDArray[np.intp]


class MotionWords:
    """Collects them, one for each object and reason."""

    def __init__(self, record: SceneRecord, settings: MotionSettings) -> None:
        self._record = record
        pairs = zip(record.objects, settings.steps.tolist(), strict=True)
        self._at_rest = {owner.session_uid for owner, steps in pairs if not steps}
        self._rows: dict[NotShown, None] = {}  # in the order of their instances
        self._new: dict[int, tuple[ObjectRecord, int, bool]] = {}  # by the owner's session uid

    @property
    def rows(self) -> tuple[NotShown, ...]:
        """Returns all rows."""
        return (*self._rows, *(self._new_row(*new) for new in self._new.values()))

    def add_missing(self, missing: BoolArray) -> None:
        """(I,) bool: instances that are not there at all of their moments."""
        for owner, count, is_plain in _owners(self._record, np.flatnonzero(missing)):
            self._rows[self._missing_row(owner, count, is_plain)] = None

    def add_reordered(self, rows: IntArray) -> None:
        """Adds instances without ids whose order changes."""
        for owner, count, _ in _owners(self._record, rows):
            self._rows[self._reordered_row(owner, count)] = None

    def add_flat(self, rows: IntArray) -> None:
        """Adds instances that a transform flattens at one of their time samples."""
        for owner, count, is_plain in _owners(self._record, rows):
            self._rows[self._flat_row(owner, count, is_plain)] = None

    def add_remade(self, remade: BoolArray, verdict: int) -> None:
        """Adds instances whose mesh changes between their time samples: (I,) bool."""
        instances = self._record.instances
        rows = np.flatnonzero(remade)
        objects, first = np.unique(instances.object_indices[rows], return_index=True)
        for number, row in zip(objects, rows[first], strict=True):
            kind = self._record.meshes[instances.mesh_indices[row]].kind
            self._rows[self._remade_row(self._record.objects[number], kind, verdict)] = None

    def add_new(self, moment: MatchedMoment) -> None:
        """Instances that the scene at the frame lacks."""
        if not len(moment.new_rows):
            return
        for owner, count, is_plain in _owners(moment.moment, moment.new_rows):
            if owner.session_uid not in self._at_rest:
                known = self._new.get(owner.session_uid, (owner, 0, is_plain))
                self._new[owner.session_uid] = (known[0], max(known[1], count), is_plain)

    def add_camera(self, settings: MotionSettings, complaint: str) -> None:
        """The camera's view cannot be followed."""
        text = f"its motion is unsupported, because it cannot be followed through the shutter: {complaint}; {_STILL}"
        self._rows[NotShown("shape", settings.camera_name, settings.camera_uid, text, _OF_CAMERA)] = None

    # The words. owner: whose instances, count of them; is_plain: the object itself is the only one -------------------

    def _missing_row(self, owner: ObjectRecord, count: int, is_plain: bool) -> NotShown:
        subject = "it is" if is_plain else _instances(count)
        text = f"{subject} missing at a moment of the shutter; {_still(count, is_plain)}"
        return row_of(owner, text, _OF_MISSING)

    def _new_row(self, owner: ObjectRecord, count: int, is_plain: bool) -> NotShown:
        subject = "it is" if is_plain else _instances(count)
        text = f"{subject} missing at the frame, but not at another moment of the shutter; left out"
        return row_of(owner, text, _OF_MISSING)

    def _reordered_row(self, owner: ObjectRecord, count: int) -> NotShown:
        text = f"{count:,} of its instances have no ids and change places within the shutter, as if sorted again"
        return row_of(owner, f"{text}; {_still(count, False)}", _OF_ORDER)

    def _flat_row(self, owner: ObjectRecord, count: int, is_plain: bool) -> NotShown:
        whose = "its scale is" if is_plain else f"the scale of {count:,} of its instances is"
        return row_of(owner, f"{whose} zero at a moment of the shutter; {_still(count, is_plain)}", _OF_FLAT)

    def _remade_row(self, owner: ObjectRecord, kind: str, verdict: int) -> NotShown:
        change = f"has different {kind} at a moment of the shutter"
        if verdict == BARE:
            change = "has points whose radius is zero at one moment of the shutter and not at another"
        return row_of(owner, f"its shape {change}; the one at the frame is shown, moved as a whole", _OF_SHAPES)


def _still(count: int, is_plain: bool) -> str:
    return _STILL if is_plain or count == 1 else _STILL.replace("it stands", "they stand")


def _owners(record: PlacedInstances, rows: npt.NDArray[np.integer[Any]]) -> list[tuple[ObjectRecord, int, bool]]:
    """Whose these instances are: objects or instancers, how many each has, and whether it is the object itself."""
    parents = record.instances.parent_indices[rows]
    owners = np.where(parents < 0, record.instances.object_indices[rows], parents)
    found, first, counts = np.unique(owners, return_index=True, return_counts=True)
    is_plain = (parents[first] < 0).tolist()
    named = [record.objects[row] for row in found]
    return list(zip(named, counts.tolist(), is_plain, strict=True))


def _instances(count: int) -> str:
    return f"{count:,} of its instances {'is' if count == 1 else 'are'}"


def row_of(owner: ObjectRecord, text: str, advice: str) -> NotShown:
    """Makes a row for an object that does not move or is not shown because it cannot be followed."""
    return NotShown("shape", owner.name, owner.session_uid, text, advice)


# Motion --------------------------------------------------------------------------------------------------------------


# A matrix whose largest entry is 1 and whose determinant is below this flattens space: its rotation is undefined.
_FLAT = 1e-24
_APART = "apart"  # first in the keys of meshes that others have at the frame and that move otherwise


def add_motion(
    record: SceneRecord,
    moments: Mapping[Fraction, MomentRecord],
    settings: MotionSettings,
    make_words: Callable[[SceneRecord, MotionSettings], MotionWords] = MotionWords,
) -> SceneRecord:
    """Returns the record with all its motion; its `not_shown` and its warnings list objects that do not move.

    moments: of the scene at each of `settings.times`. If several instances share a mesh and do not deform alike
    at all of them, it becomes several meshes. make_words: the wording of the rows.
    """
    matcher = MomentMatcher(record)
    matched = {time: matcher.match(moment) for time, moment in moments.items()}
    words = make_words(record, settings)
    for time in settings.times:
        words.add_new(matched[time])
    steps, deforms = _of_instances(record, settings)
    motions: list[InstanceMotions] = []
    shapes = _Shapes(record)
    for count in np.unique(steps[steps > 0]).tolist():
        at = [matched[time] for time in times_of(count)]
        asked = steps == count
        there = np.logical_and.reduce([moment.rows >= 0 for moment in at])
        words.add_missing(asked & ~there)
        reordered = find_reordered(record, at, asked & there)
        words.add_reordered(np.flatnonzero(reordered))
        followed = asked & there & ~reordered
        motions += _move(record, at, followed, words)
        shapes.add(at, followed & deforms, words)
    meshes, columns, mesh_motions = shapes.split()
    camera = _camera_motion(record, moments, settings, words)
    not_shown = words.rows
    return replace(
        record,
        meshes=meshes,
        instances=record.instances if columns is None else replace(record.instances, mesh_indices=columns),
        motion=SceneMotion(tuple(motions), tuple(mesh_motions), camera),
        not_shown=(*record.not_shown, *not_shown),
        warnings=(*record.warnings, *map(str, not_shown)),
    )


def _of_instances(record: SceneRecord, settings: MotionSettings) -> tuple[Int32Array, BoolArray]:
    """Returns (I,) steps and whether shapes may change, if both object and instancer allow it, as in Cycles."""
    steps = np.append(settings.steps, 0).astype(np.int32)
    deforms = np.append(settings.deforms, True)
    objects, parents = record.instances.object_indices, record.instances.parent_indices
    own, parent = steps[objects], steps[parents]
    is_plain = parents < 0
    both = np.where((own > 0) & (parent > 0), np.maximum(own, parent), 0)
    return np.where(is_plain, own, both).astype(np.int32), np.asarray(deforms[objects] & deforms[parents])


def _move(record: SceneRecord, at: list[MatchedMoment], asked: BoolArray, words: MotionWords) -> list[InstanceMotions]:
    """Returns those of the requested instances, which exist at each time sample, whose transforms differ."""
    rows = np.flatnonzero(asked & np.logical_or.reduce([moment.moved for moment in at]))
    if not len(rows):
        return []
    transforms = np.stack([moment.moment.instances.transforms[moment.rows[rows]] for moment in at])
    flat = _flattens(transforms).any(axis=0)
    if flat.any():
        words.add_flat(rows[flat])
        rows, transforms = rows[~flat], transforms[:, ~flat]
    return [InstanceMotions(rows.astype(np.int32), transforms)] if len(rows) else []


def _flattens(transforms: Float32Array) -> BoolArray:
    """Returns (S, K): whether the rotation of the matrix is undefined."""
    linear = transforms[..., :3].astype(np.float64)
    largest = np.abs(linear).max(axis=(-2, -1))
    a, b, c = (linear[..., axis] / np.where(largest > 0.0, largest, 1.0)[..., None] for axis in range(3))
    determinants = np.einsum("ski,ski->sk", a, np.cross(b, c))
    return np.asarray(~(np.abs(determinants) > _FLAT))


@dataclass(slots=True)
class _Deformed:
    """Instances whose mesh deforms alike: (K,) rows of the scene's, and the mesh at each moment."""

    instances: IntArray
    shapes: list[MeshRecord]


class _Shapes:
    """Gathers what deforms, then gives each mesh its motion."""

    def __init__(self, record: SceneRecord) -> None:
        self._record = record
        self._found: dict[int, list[_Deformed]] = {}  # by the mesh's row

    def add(self, at: list[MatchedMoment], asked: BoolArray, words: MotionWords) -> None:
        """at: the moments of the instances that are asked for, which are there at each of them."""
        worst = np.maximum.reduce([moment.shapes for moment in at])
        for verdict in (REMADE, BARE):
            words.add_remade(asked & (worst == verdict), verdict)
        rows = np.flatnonzero(asked & (worst == DEFORMED))
        if not len(rows):
            return
        groups = self._record.instances.mesh_indices[rows].astype(np.int64)
        for moment in at:
            pairs = groups * len(moment.moment.meshes) + moment.mesh_rows(rows)
            groups = np.unique(pairs, return_inverse=True)[1].reshape(-1)
        for number in range(int(groups.max()) + 1):
            members = rows[groups == number]
            first = members[:1]
            shapes = [moment.moment.meshes[int(moment.mesh_rows(first)[0])] for moment in at]
            row = int(self._record.instances.mesh_indices[first[0]])
            self._found.setdefault(row, []).append(_Deformed(members, shapes))

    def split(self) -> tuple[tuple[MeshRecord, ...], Int32Array | None, list[MeshMotion]]:
        """The scene's meshes, which mesh each instance shows if that is not as before, and the motions."""
        meshes, motions = list(self._record.meshes), []
        columns = self._record.instances.mesh_indices
        counts = np.bincount(columns, minlength=len(meshes))
        changed: Int32Array | None = None
        for row, found in sorted(self._found.items()):
            rest = int(counts[row]) - sum(len(one.instances) for one in found)
            for number, one in enumerate(found):
                place = row
                if rest or number:
                    changed = columns.copy() if changed is None else changed
                    place = len(meshes)
                    changed[one.instances] = place
                    mesh = self._record.meshes[row]
                    meshes.append(replace(mesh, key=(_APART, mesh.key, number)))
                motions.append(_mesh_motion(place, one.shapes))
        whole = self._record.meshes if changed is None else tuple(meshes)
        return whole, changed, motions


def without_parting(record: SceneRecord) -> SceneRecord:
    """Returns the record as it was read: meshes that were split for their motions are merged again."""
    keys = [mesh.key for mesh in record.meshes]
    whole = [key for key in keys if not _is_apart(key)]
    if len(whole) == len(keys):
        return record
    places = {key: row for row, key in enumerate(whole)}
    rows = np.array([places[key[1] if _is_apart(key) else key] for key in keys], np.int32)  # type: ignore[index]
    return replace(
        record,
        meshes=tuple([mesh for mesh in record.meshes if not _is_apart(mesh.key)]),
        instances=replace(record.instances, mesh_indices=rows[record.instances.mesh_indices]),
    )


def _is_apart(key: Hashable) -> bool:
    return isinstance(key, tuple) and len(key) == 3 and key[0] == _APART


def _mesh_motion(row: int, shapes: list[MeshRecord]) -> MeshMotion:
    radii = [shape.radii for shape in shapes if shape.radii is not None]
    return MeshMotion(row, np.stack([shape.positions for shape in shapes]), np.stack(radii) if radii else None)


def _camera_motion(
    record: SceneRecord, moments: Mapping[Fraction, MomentRecord], settings: MotionSettings, words: MotionWords
) -> tuple[CameraRecord, ...]:
    if not settings.camera_steps or record.camera is None:
        return ()
    at = [moments[time] for time in times_of(settings.camera_steps)]
    cameras = [moment.camera for moment in at if moment.camera is not None]
    if len(cameras) < len(at):
        complaint = next((moment.complaint for moment in at if moment.complaint), "it is missing at one of the moments")
        words.add_camera(settings, complaint)
        return ()
    if any(camera.projection != record.camera.projection for camera in cameras):
        words.add_camera(settings, "its type changes")
        return ()
    if all(is_same_camera(camera, record.camera) for camera in cameras):
        return ()
    return tuple(cameras)


# Stretch words -------------------------------------------------------------------------------------------------------
# The objects whose motion a scan does not follow between two time samples, with the same words each time.


_OF_STRETCH_ORDER = "Give the points ids, by Set ID, before nodes change their order"
_ADVICE = "Raise Steps per Frame, for less time between two time samples"


class StretchWords(MotionWords):
    """The words for an interval between two time samples. Without numbers, which differ from interval to interval."""

    def _missing_row(self, owner: ObjectRecord, count: int, is_plain: bool) -> NotShown:
        subject = "it disappears" if is_plain else "some of its instances disappear"
        still = "it stands still, as at the earlier one" if is_plain else "they stand still, as at the earlier one"
        return row_of(owner, f"{subject} between two time samples of the scan; until the later one {still}", _ADVICE)

    def _new_row(self, owner: ObjectRecord, count: int, is_plain: bool) -> NotShown:
        subject, hit = ("it appears", "it is") if is_plain else ("some of its instances appear", "they are")
        text = f"{subject} between two time samples of the scan; until the later one {hit} not hit"
        return row_of(owner, text, _ADVICE)

    def _reordered_row(self, owner: ObjectRecord, count: int) -> NotShown:
        text = "instances without ids change places between two time samples of the scan, as if sorted again"
        return row_of(owner, f"{text}; until the later one they stand still, as at the earlier one", _OF_STRETCH_ORDER)

    def _flat_row(self, owner: ObjectRecord, count: int, is_plain: bool) -> NotShown:
        whose, subject = (
            ("its scale", "it stands") if is_plain else ("the scale of some of its instances", "they stand")
        )
        text = f"{whose} is zero at a time sample of the scan; before and after that {subject} still"
        return row_of(owner, f"{text}, as at the earlier one", _ADVICE)

    def _remade_row(self, owner: ObjectRecord, kind: str, verdict: int) -> NotShown:
        change = f"gets different {kind} between two time samples of the scan"
        if verdict == BARE:
            change = "has points whose radius is zero at one of two time samples of the scan and not at the other"
        return row_of(owner, f"its shape {change}; until the later one it keeps the earlier one's", _ADVICE)
