"""A scene and a view layer of it, for work that goes on while Blender's user does.

Between two steps an undo may replace all of Blender's data-blocks, and the user delete the scene or show another one in
the window. So each step looks for the scene by what stays the same.
"""

from __future__ import annotations

import bpy


class SceneReference:
    """task: what the work is called, for messages."""

    def __init__(self, task: str, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> None:
        self._task = task
        self._uid, self._layer_name = scene.session_uid, view_layer.name

    def find(self) -> bpy.types.Scene:
        """The scene. Raises ValueError if it or its view layer is gone."""
        scene = self._find()
        if scene is None:
            raise ValueError(f"{self._task}: the scene was removed during the {self._task}")
        if self._layer_name not in scene.view_layers:
            raise ValueError(f"{self._task}: the view layer {self._layer_name!r} was removed during the {self._task}")
        return scene

    def find_layer(self) -> bpy.types.ViewLayer:
        """The view layer. Raises ValueError like `find`."""
        return self.find().view_layers[self._layer_name]

    def depsgraph(self) -> bpy.types.Depsgraph:
        """Evaluated, as the scene is now. Raises ValueError like `find`."""
        with bpy.context.temp_override(scene=self.find(), view_layer=self.find_layer()):
            return bpy.context.evaluated_depsgraph_get()

    def set_frame_back(self, frame: int, subframe: float = 0.0, camera_uid: int = 0) -> None:
        """At the end, if the scene still is there and shows another one.

        camera_uid: the session uid of the camera that it had, 0 for none: where frames have markers with cameras of
        their own, going through them has changed it.
        """
        scene = self._find()
        if scene is None or (scene.frame_current, scene.frame_subframe) == (frame, subframe):
            return
        scene.frame_set(frame, subframe=subframe)
        camera = next((obj for obj in scene.objects if obj.session_uid == camera_uid), None)
        if camera is not None and scene.camera != camera:
            scene.camera = camera

    def _find(self) -> bpy.types.Scene | None:
        return next((scene for scene in bpy.data.scenes if scene.session_uid == self._uid), None)
