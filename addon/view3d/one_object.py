"""One object of a scene's record: its mesh and its place, without anything of Blender."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..sync.records import MeshRecord, SceneRecord


@dataclass(frozen=True, slots=True)
class OneObject:
    """An object, and where it is.

    mesh: as rays meet it. matrix: (4, 4) from its space to the world; of an object that only instances show, the first
    of these. instance: its row of the record.
    """

    name: str
    session_uid: int
    mesh: MeshRecord
    matrix: npt.NDArray[np.float64]
    instance: int


def find_object(record: SceneRecord, session_uid: int) -> OneObject | None:
    """None if rays meet no such object. One that is a plain object as well as instances: the object."""
    rows = [row for row, shown in enumerate(record.objects) if shown.session_uid == session_uid]
    places = np.flatnonzero(np.isin(record.instances.object_indices, rows))
    if not len(places):
        return None
    own = places[record.instances.parent_indices[places] < 0]
    place = int(own[0] if len(own) else places[0])
    matrix = np.eye(4)
    matrix[:3] = record.instances.transforms[place]
    mesh = record.meshes[record.instances.mesh_indices[place]]
    name = record.objects[record.instances.object_indices[place]].name
    return OneObject(name, session_uid, mesh, matrix, place)
