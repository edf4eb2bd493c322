"""A failure case's states as records for sync: the decisions are sync's, not the test's."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import perfect_bvh
from makers.zoo import Body, State
from makers.zoo.case import finite
from perfect_bvh_addon.sync.records import InstanceRecords, MeshRecord, ObjectRecord, SceneRecord
from perfect_bvh_addon.sync.report import SyncReport
from perfect_bvh_addon.sync.state import SceneState

from stress.playing import Moment


def as_blender_has_it(state: State) -> State:
    """Positions and matrices in float32."""
    return tuple(
        Body(part.name, np.float32(part.positions), part.triangles, np.float32(part.transforms).astype(np.float64))
        for part in finite(state)
    )


def record_of(state: State, frame: float, uids: dict[str, int]) -> SceneRecord:
    """One object for each instance; `uids` keeps the number of each name for the next frame."""
    meshes, objects, mesh_indices, transforms = [], [], [], []
    for row, part in enumerate(state):
        polygons = np.arange(len(part.triangles), dtype=np.int32)
        meshes.append(MeshRecord((part.name,), part.name, part.positions, part.triangles, polygons))
        for place, transform in enumerate(part.transforms):
            name = f"{part.name}.{place:03}"
            objects.append(ObjectRecord(name, uids.setdefault(name, len(uids) + 1), 0))
            mesh_indices.append(row)
            transforms.append(transform[:3])
    count = len(objects)
    instances = InstanceRecords(
        mesh_indices=np.array(mesh_indices, np.int32),
        object_indices=np.arange(count, dtype=np.int32),
        parent_indices=np.full(count, -1, np.int32),
        transforms=np.array(transforms, np.float32).reshape(count, 3, 4),
        masks=np.full(count, 0x3F, np.uint32),
        persistent_ids=np.zeros((count, 8), np.int32),
    )
    return SceneRecord("scene", frame, tuple(meshes), tuple(objects), (), instances, None, (16, 9))


def sync(states: tuple[State, ...]) -> Iterator[tuple[Moment, SyncReport]]:
    """One scene that sync keeps in step with state after state."""
    kept, uids = SceneState(perfect_bvh.Scene), {}
    for frame, state in enumerate(map(as_blender_has_it, states)):
        report = kept.update(record_of(state, float(frame), uids))
        sizes = np.cumsum([len(part.transforms) for part in state])[:-1]
        ids = tuple(np.split(kept.instance_ids, sizes))
        yield Moment(kept.scene, state, ids, report.commit), report
