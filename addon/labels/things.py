"""What labels' numbers stand for: instances, with the names and labels that users gave their objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..extract.label_values import collections_of_objects
from ..sync.label_columns import LabelValue, SceneLabel
from ..sync.lookup import MISS

if TYPE_CHECKING:
    from ..live.scene_sync import SceneSync


@dataclass(frozen=True, slots=True)
class Thing:
    """One object, or one instance of it, in a labelled image.

    name: of the object. instancer: the name of the object that shows it, "" for a plain one. instance_id: of this
    instance; it lasts while its sync does. pass_index: the object's. category: a row of the image's categories, -1 for
    none. collections: the names of all that hold the object itself, sorted. labels: the values of those that were asked
    for, by name, None for none; where only materials have a label, what all of the object's agree on.
    """

    name: str
    instancer: str
    instance_id: int
    pass_index: int
    category: int = MISS
    collections: tuple[str, ...] = ()
    labels: Mapping[str, LabelValue] = field(default_factory=dict)


def find_things(
    sync: SceneSync, instance_ids: npt.NDArray[np.int32], category: SceneLabel, labels: Mapping[str, SceneLabel]
) -> tuple[tuple[Thing, ...], tuple[str, ...]]:
    """A thing for each of (N,) instances, and the categories' names.

    category: the label that says them, of names. labels: others by their names.
    """
    found, rows = sync.describe(instance_ids), sync.instance_rows(instance_ids)
    indices = {obj.session_uid: obj.pass_index for obj in sync.record.objects}
    holders = collections_of_objects()
    names = category.table.names or ()
    numbers = {name: row for row, name in enumerate(names)}
    categories = category.of_things(sync.record, rows)
    columns = {name: label.of_things(sync.record, rows) for name, label in labels.items()}
    things = []
    for row, uid in enumerate(found.session_uids.tolist()):
        things.append(
            Thing(
                name=str(found.names[row]),
                instancer=str(found.parent_names[row]),
                instance_id=int(instance_ids[row]),
                pass_index=indices.get(uid, 0),
                category=numbers.get(str(categories[row]), MISS) if categories[row] is not None else MISS,
                collections=holders.get(uid, ()),
                labels={name: values[row] for name, values in columns.items()},
            )
        )
    return tuple(things), names
