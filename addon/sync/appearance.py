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
    """Each instance's materials, one after the other: those of its object.

    A triangle may refer to a slot that the object lacks; the renderer, as Blender, shows it in the last one.
    """
    instances = record.instances
    if not len(instances):
        return InstanceTable()
    objects = instances.object_indices
    flat = np.array([row for obj in record.objects for row in obj.material_slots], np.int64)
    counts = np.array([len(obj.material_slots) for obj in record.objects], np.int64)
    firsts = np.cumsum(counts) - counts

    instance_counts = counts[objects]
    offsets = np.concatenate([[0], np.cumsum(instance_counts)])
    places = np.arange(offsets[-1]) - np.repeat(offsets[:-1], instance_counts)
    places += np.repeat(firsts[objects], instance_counts)
    return InstanceTable(
        ids=instance_ids,
        slot_offsets=offsets.astype(np.int32),
        slot_materials=flat[places].astype(np.int32),
        object_indices=np.array([obj.pass_index for obj in record.objects], np.int32)[instances.object_indices],
        holdout=np.array([obj.holdout for obj in record.objects], np.bool_)[instances.object_indices],
    )
