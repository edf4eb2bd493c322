"""Reads a scene of plain objects again if Blender has only evaluated transforms and settings.

Reading all properties of all objects takes longer than everything else in a frame in which one of ten thousand moved.
This module reads only the identity and the transform of all objects, and more of those that Blender reports. After any
other change, the whole scene is read.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from perfect_bvh.bulk import place_instances

from ..events.asking import EvaluationLog
from ..sync.look_records import ImageRecord, MaterialRecord, WorldRecord
from ..sync.not_shown import NotShown
from ..sync.records import (
    LARGEST_COORDINATE,
    AttributeRequest,
    Float32Array,
    InstanceRecords,
    Int32Array,
    MeshRecord,
    ObjectRecord,
    UnseenMesh,
)
from .geometry.instancer_survey import SILENT_TYPES
from .looks.images import ImageCache
from .looks.lights import lights_few
from .visibility import VisibilityReader

_NOT_SHOWN = -1


@dataclass(frozen=True, slots=True)
class SceneParts:
    """A reading without the camera and the lights, which are read every time."""

    meshes: tuple[MeshRecord, ...]
    objects: tuple[ObjectRecord, ...]
    materials: tuple[MaterialRecord, ...]
    images: tuple[ImageRecord, ...]
    instances: InstanceRecords
    world: WorldRecord | None
    instance_values: Float32Array | None
    materials_follow: bool  # other objects, by where these are
    unseen: tuple[UnseenMesh, ...]
    instances_lights: bool
    warnings: tuple[str, ...]
    not_shown: tuple[NotShown, ...]


@dataclass(frozen=True, slots=True)
class PlainReading:
    """A reading of only plain objects, with the data that decides whether it is still valid.

    attributes, graph, look: the request, the depsgraph (its address), and the visibility. since: the log's
    time. uids: of all evaluated objects. rows: (N,) int32, of each of them, its row among the instances, or -1.
    """

    parts: SceneParts
    attributes: AttributeRequest
    graph: int
    look: tuple[Any, ...]
    since: int
    uids: list[int]
    rows: Int32Array


def remember(
    parts: SceneParts,
    shown: npt.NDArray[np.bool_] | None,
    depsgraph: Any,
    attributes: AttributeRequest,
    visibility: VisibilityReader,
    log: EvaluationLog | None,
) -> PlainReading | None:
    """Return a reading; None if it cannot be read again.

    shown: the evaluated objects that are instances; None if there are others.
    """
    look = visibility.look
    if shown is None or log is None or look is None:
        return None
    # Which objects' places and properties materials depend on is not kept.
    if parts.instance_values is not None or parts.materials_follow:
        return None
    originals = [obj.original for obj in depsgraph.objects]
    # Blender may not report changes of objects in edit or sculpt mode: they are read every time.
    if len(originals) != len(shown) or any(original.mode != "OBJECT" for original in originals):
        return None
    uids = [original.session_uid for original in originals]
    rows = np.where(shown, np.cumsum(shown) - 1, _NOT_SHOWN).astype(np.int32)
    return PlainReading(parts, attributes, depsgraph.as_pointer(), look, log.now, uids, rows)


def read_again(
    last: PlainReading | None,
    depsgraph: Any,
    attributes: AttributeRequest,
    visibility: VisibilityReader,
    log: EvaluationLog | None,
    images: ImageCache,
) -> SceneParts | None:
    """The last reading with today's transforms, or None if that may not be all that changed."""
    if last is None or log is None or last.attributes != attributes or last.look != visibility.look:
        return None
    graph = depsgraph.as_pointer()
    touched = log.find_touched(graph, last.since) if graph == last.graph else None
    if touched is None or not images.is_current():
        return None
    objects = list(depsgraph.objects)
    uids = [obj.original.session_uid for obj in objects]
    if uids != last.uids:
        return None
    for obj, uid, row in zip(objects, uids, last.rows.tolist(), strict=True):
        if uid in touched and not _is_as_before(obj, row, last.parts, visibility):
            return None
    matrices = np.empty((len(objects), 4, 4), np.float32)
    depsgraph.objects.foreach_get("matrix_world", matrices.reshape(-1))
    shown = matrices[last.rows != _NOT_SHOWN]
    transforms = np.empty((len(shown), 3, 4), np.float32)
    if len(place_instances(None, shown, transforms, LARGEST_COORDINATE)):
        return None
    return replace(last.parts, instances=replace(last.parts.instances, transforms=transforms))


def _is_as_before(obj: Any, row: int, parts: SceneParts, visibility: VisibilityReader) -> bool:
    """Whether an evaluated object differs in its transform alone, if at all."""
    if obj.original.mode != "OBJECT" or obj.is_instancer:
        return False
    uid = obj.original.session_uid
    if lights_few(obj) or any(row.session_uid == uid for row in parts.not_shown if row.kind == "light"):
        return False  # the reported settings of its light may have changed
    if row == _NOT_SHOWN:
        return obj.type in SILENT_TYPES
    record = parts.objects[parts.instances.object_indices[row]]
    slots = tuple(
        [None if slot.material is None else slot.material.original.session_uid for slot in obj.material_slots]
    )
    return bool(
        not visibility.is_hidden(obj, None)
        and visibility.mask(obj, None) == parts.instances.masks[row]
        and visibility.is_holdout(obj, None) == record.holdout
        and (obj.original.name, obj.pass_index) == (record.name, record.pass_index)
        and slots == tuple([None if slot < 0 else parts.materials[slot].session_uid for slot in record.material_slots])
    )
