"""A record's materials and attributes as the engine's `Appearance`: the renderer's only knowledge of colour."""

from __future__ import annotations

import numpy as np
from perfect_bvh.appearance import Appearance, InstanceTable, MaterialTable, MeshAppearance

from .records import VISIBLE_TO_CAMERA, VISIBLE_TO_SHADOW, Int32Array, SceneRecord


def make_appearance(record: SceneRecord, instance_ids: Int32Array, mesh_ids: Int32Array) -> Appearance:
    """instance_ids: (I,) and mesh_ids: (M,), the engine's ids of the record's instances and meshes."""
    meshes = {
        int(mesh_id): MeshAppearance(mesh.material_slots, mesh.corner_normals, mesh.corner_uvs)
        for mesh_id, mesh in zip(mesh_ids, record.meshes, strict=True)
    }
    materials = MaterialTable(
        colors=np.array([material.color for material in record.materials], np.float32).reshape(-1, 4),
        indices=np.array([material.pass_index for material in record.materials], np.int32),
    )
    return Appearance(
        meshes=meshes,
        instances=_instance_table(record, instance_ids),
        materials=materials,
        camera_mask=VISIBLE_TO_CAMERA,
        shadow_mask=VISIBLE_TO_SHADOW,
        film_transparent=record.film_transparent,
    )


def _instance_table(record: SceneRecord, instance_ids: Int32Array) -> InstanceTable:
    """Each instance's materials, one after the other; made once a pair of object and mesh, then gathered."""
    instances = record.instances
    if not len(instances):
        return InstanceTable()
    slot_counts = _slots_in_use(record)
    pairs = np.stack([instances.object_indices, instances.mesh_indices], axis=1)
    distinct, pair_of_instance = np.unique(pairs, axis=0, return_inverse=True)
    pair_of_instance = pair_of_instance.reshape(-1)  # numpy 2.0 alone shaped it like the input
    lists = [_padded_slots(record.objects[obj].material_slots, slot_counts[mesh]) for obj, mesh in distinct]
    flat = np.array([row for slots in lists for row in slots], np.int64)
    counts = np.array([len(slots) for slots in lists], np.int64)
    firsts = np.cumsum(counts) - counts

    instance_counts = counts[pair_of_instance]
    offsets = np.concatenate([[0], np.cumsum(instance_counts)])
    places = np.arange(offsets[-1]) - np.repeat(offsets[:-1], instance_counts)
    places += np.repeat(firsts[pair_of_instance], instance_counts)
    return InstanceTable(
        ids=instance_ids,
        slot_offsets=offsets.astype(np.int32),
        slot_materials=flat[places].astype(np.int32),
        object_indices=np.array([obj.pass_index for obj in record.objects], np.int32)[instances.object_indices],
        holdout=np.array([obj.holdout for obj in record.objects], np.bool_)[instances.object_indices],
    )


def _slots_in_use(record: SceneRecord) -> list[int]:
    """For each mesh, how many slots its triangles refer to."""
    return [
        1 if mesh.material_slots is None or not len(mesh.material_slots) else int(mesh.material_slots.max()) + 1
        for mesh in record.meshes
    ]


def _padded_slots(slots: tuple[int, ...], count: int) -> tuple[int, ...]:
    """Slots for every index in use: Blender shows triangles of a slot that the object lacks in its last one."""
    if not slots or len(slots) >= count:
        return slots
    return slots + (slots[-1],) * (count - len(slots))
