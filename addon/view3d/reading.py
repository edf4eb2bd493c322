"""An object as rays hit it, read from Blender: now, or in another frame."""

from __future__ import annotations

import bpy

from ..extract.scene import read_scene
from ..sync.records import AttributeRequest, SceneRecord
from .pointer import OneObject, find_object

# Trees need no more than triangles.
NOTHING_BESIDE = AttributeRequest(material_slots=False)


def read_object(context: bpy.types.Context, obj: bpy.types.Object, frame: int | None = None) -> OneObject:
    """Raises ValueError if rays cannot meet it. frame: after which the current one is shown again; None for that."""
    scene = context.scene
    if frame is None or frame == scene.frame_current:
        return find_in(read_record(context.evaluated_depsgraph_get()), obj.name, obj.session_uid)
    name, session_uid = obj.name, obj.session_uid
    before = scene.frame_current, scene.frame_subframe
    try:
        scene.frame_set(frame)
        return find_in(read_record(context.evaluated_depsgraph_get()), name, session_uid)
    finally:
        scene.frame_set(before[0], subframe=before[1])


def read_record(depsgraph: bpy.types.Depsgraph) -> SceneRecord:
    """Triangles and places of what viewports show."""
    return read_scene(depsgraph, NOTHING_BESIDE, for_viewport=True)


def find_in(record: SceneRecord, name: str, session_uid: int) -> OneObject:
    """Raises ValueError if rays cannot meet the object."""
    shown = find_object(record, session_uid)
    if shown is None or not len(shown.mesh.triangles):
        raise ValueError(f"{name} has no triangles that rays can hit in frame {record.frame:g}")
    return shown
