"""What labels' numbers stand for: instances, with the names and numbers that users gave their objects."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..sync.lookup import MISS

if TYPE_CHECKING:
    from ..live.scene_sync import SceneSync


@dataclass(frozen=True, slots=True)
class Thing:
    """One object, or one instance of it, in a labelled image.

    name: of the object. instancer: the name of the object that shows it, "" for a plain one. instance_id: of this
    instance; it lasts while its sync does. pass_index: the object's. category: a row of the image's categories, -1 for
    none.
    """

    name: str
    instancer: str
    instance_id: int
    pass_index: int
    category: int = MISS


def find_things(
    sync: SceneSync, instance_ids: npt.NDArray[np.int32], category: str | None
) -> tuple[tuple[Thing, ...], tuple[str, ...]]:
    """A thing for each of (N,) instances, and the categories' names.

    category: the custom property that says them; of objects, else of their instancers, else of their data. None: each
    object's name is its category.
    """
    found = sync.describe(instance_ids)
    indices = {obj.session_uid: obj.pass_index for obj in sync.record.objects}
    if category is None:
        values = [str(name) for name in found.names]
    else:
        pairs = zip(found.session_uids.tolist(), found.parent_session_uids.tolist(), strict=True)
        values = _properties(category, pairs)
    names = tuple(sorted({value for value in values if value}, key=_by_number))
    rows = {name: row for row, name in enumerate(names)} | {"": MISS}
    things = [
        Thing(str(name), str(parent), int(identifier), indices.get(int(uid), 0), rows[value])
        for name, parent, identifier, uid, value in zip(
            found.names, found.parent_names, instance_ids, found.session_uids, values, strict=True
        )
    ]
    return tuple(things), names


def _properties(name: str, uids: Iterable[tuple[int, int]]) -> list[str]:
    """Of each object and its instancer, by session uid; "" where nothing has it."""
    import bpy

    objects = {obj.session_uid: obj for obj in bpy.data.objects}
    known: dict[tuple[int, int], str] = {}
    result = []
    for pair in uids:
        if pair not in known:
            known[pair] = _property(name, [objects.get(uid) for uid in pair])
        result.append(known[pair])
    return result


def _property(name: str, owners: list[Any]) -> str:
    data = [getattr(owner, "data", None) for owner in owners]
    for owner in (*owners, *data):
        value = None if owner is None else owner.get(name)
        if value is not None:
            return str(value)
    return ""


def _by_number(text: str) -> tuple[int, float, str]:
    """Numbers by their size, before all other names."""
    try:
        return 0, float(text), text
    except ValueError:
        return 1, 0.0, text
