"""The scene that Blender shows, as the subject of a measurement."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..extract import ReadCache, read_scene
from .subject import Subject

if TYPE_CHECKING:
    import bpy

    from ..sync.records import SceneRecord


def subject_of(scene: bpy.types.Scene) -> Subject:
    """The current frame, with what renders see; other frames are read when they are asked for."""
    import bpy

    cache = ReadCache()

    def read(frame: int) -> SceneRecord:
        scene.frame_set(frame)
        return read_scene(bpy.context.evaluated_depsgraph_get(), for_viewport=False, cache=cache)

    record = read_scene(bpy.context.evaluated_depsgraph_get(), for_viewport=False)
    return Subject(scene.name, record, range(scene.frame_start, scene.frame_end + 1, scene.frame_step), read)
