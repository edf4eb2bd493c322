"""The scene that Blender shows, as the subject of a measurement."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..extract import ReadCache, read_scene
from .subject import Subject

if TYPE_CHECKING:
    import bpy

    from ..sync.records import SceneRecord


def subject_of(scene: bpy.types.Scene, *, for_viewport: bool = False) -> Subject:
    """The current frame, as renders see it, or with `for_viewport` as viewports do; others are read when asked for.

    Then the scene may be gone: that is a ValueError.
    """
    import bpy

    from ..live.scene_view import SceneView

    cache = ReadCache()
    layer = bpy.context.view_layer if scene == bpy.context.scene else scene.view_layers[0]
    view = SceneView("bench", scene, layer, for_viewport=for_viewport)

    def read(frame: int) -> SceneRecord:
        return view.read(lambda moment: read_scene(moment.depsgraph, cache=cache), frame)

    record = view.read(lambda moment: read_scene(moment.depsgraph))
    return Subject(scene.name, record, range(scene.frame_start, scene.frame_end + 1, scene.frame_step), read)
