"""The scene that Blender shows, as the subject of a measurement."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..extract import ReadCache, read_scene
from .subject import Subject

if TYPE_CHECKING:
    import bpy

    from ..sync.records import SceneRecord


def subject_of(scene: bpy.types.Scene) -> Subject:
    """The current frame, with what renders see; other frames are read when they are asked for.

    Then the scene may be gone: that is a ValueError.
    """
    import bpy

    from ..live.scene_reference import SceneReference

    cache = ReadCache()
    is_current = scene == bpy.context.scene
    place = SceneReference("bench", scene, bpy.context.view_layer if is_current else scene.view_layers[0])

    def read(frame: int) -> SceneRecord:
        place.find().frame_set(frame)
        return read_scene(place.depsgraph(), for_viewport=False, cache=cache)

    record = read_scene(place.depsgraph(), for_viewport=False)
    return Subject(scene.name, record, range(scene.frame_start, scene.frame_end + 1, scene.frame_step), read)
