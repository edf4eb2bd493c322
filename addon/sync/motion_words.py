"""What does not move within a shutter although it should: a row each of what is not shown, in words."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .keys import PlacedInstances
from .moments import BARE, MatchedMoment, MotionSettings
from .not_shown import NotShown
from .records import BoolArray, ObjectRecord, SceneRecord

_OF_MISSING = "Bake it, or let it begin or end at a whole frame; or turn its Motion Blur off"
_OF_ORDER = "Give the points ids, by Set ID, before nodes change their order; or turn its Motion Blur off"
_OF_SHAPES = "Keep its number of points the same from frame to frame, or turn its Deformation motion blur off"
_OF_FLAT = "Scale it to a small number instead of zero, or turn its Motion Blur off"
_OF_CAMERA = "Keep the camera's type and scale usable throughout the shutter, or turn its Motion Blur off"
# Nothing of it moves; or all but what it is made of.
_STILL = "it stands still, as at the frame"

IntArray = npt.NDArray[np.intp]


class MotionWords:
    """Collects them, one for each object and reason."""

    def __init__(self, record: SceneRecord, settings: MotionSettings) -> None:
        self._record = record
        pairs = zip(record.objects, settings.steps.tolist(), strict=True)
        self._at_rest = {owner.session_uid for owner, steps in pairs if not steps}
        self._rows: dict[NotShown, None] = {}  # in the order in which they are met
        self._new: dict[int, tuple[ObjectRecord, int, bool]] = {}  # by the owner's session uid

    @property
    def rows(self) -> tuple[NotShown, ...]:
        """All of them."""
        return (*self._rows, *(self._new_row(*new) for new in self._new.values()))

    def add_missing(self, missing: BoolArray) -> None:
        """(I,) bool: instances that are not there at all of their moments."""
        for owner, count, is_plain in _owners(self._record, np.flatnonzero(missing)):
            self._rows[self._missing_row(owner, count, is_plain)] = None

    def add_reordered(self, rows: IntArray) -> None:
        """Of instances without ids whose order changes."""
        for owner, count, _ in _owners(self._record, rows):
            self._rows[self._reordered_row(owner, count)] = None

    def add_flat(self, rows: IntArray) -> None:
        """Of instances that a transform flattens at one of their moments."""
        for owner, count, is_plain in _owners(self._record, rows):
            self._rows[self._flat_row(owner, count, is_plain)] = None

    def add_remade(self, remade: BoolArray, verdict: int) -> None:
        """(I,) bool: instances whose mesh is another at one of their moments."""
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
        text = f"its motion is not shown, as it cannot be followed through the shutter: {complaint}; {_STILL}"
        self._rows[NotShown("shape", settings.camera_name, settings.camera_uid, text, _OF_CAMERA)] = None

    # The words. owner: whose instances, count of them; is_plain: the object itself is the only one -------------------

    def _missing_row(self, owner: ObjectRecord, count: int, is_plain: bool) -> NotShown:
        subject = "it is" if is_plain else _instances(count)
        text = f"{subject} not there at every moment of the shutter; {_still(count, is_plain)}"
        return row_of(owner, text, _OF_MISSING)

    def _new_row(self, owner: ObjectRecord, count: int, is_plain: bool) -> NotShown:
        subject = "it is" if is_plain else _instances(count)
        text = f"{subject} there only at other moments of the shutter than the frame; not shown"
        return row_of(owner, text, _OF_MISSING)

    def _reordered_row(self, owner: ObjectRecord, count: int) -> NotShown:
        text = f"{count:,} of its instances have no ids and trade places within the shutter, as if sorted anew"
        return row_of(owner, f"{text}; {_still(count, False)}", _OF_ORDER)

    def _flat_row(self, owner: ObjectRecord, count: int, is_plain: bool) -> NotShown:
        whose = "its scale is" if is_plain else f"the scale of {count:,} of its instances is"
        return row_of(owner, f"{whose} zero at a moment of the shutter; {_still(count, is_plain)}", _OF_FLAT)

    def _remade_row(self, owner: ObjectRecord, kind: str, verdict: int) -> NotShown:
        change = f"has other {kind} at a moment of the shutter"
        if verdict == BARE:
            change = "has points without a radius at one moment of the shutter that have one at another"
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
    """Of what stands still or is not shown because it cannot be followed."""
    return NotShown("shape", owner.name, owner.session_uid, text, advice)
