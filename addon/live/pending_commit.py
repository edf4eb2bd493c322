"""Trees that several views share, as one of them sees them: waited for a moment, then built while Blender goes on.

The Rendered viewports of a scene, its overlay and views that are rendered to an image look at the same trees. Any of
them may read Blender again, which stops what another has begun, and Esc gives up what others wait for. So all wait for
whatever was begun last, and what one view has given up is begun again by the next that needs it. All of this is on
Blender's main thread.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import bpy

if TYPE_CHECKING:
    from ..sync.report import SyncReport
    from .scene_sync import SceneSync, UpdateCommit


# Trees that take no longer are waited for: their image comes in the redraw in which the scene was edited. Others are
# built while Blender goes on, and every redraw looks for so long whether they are there.
BUILDING_SECONDS = 0.25
LOOKING_SECONDS = 0.03


class PendingCommit:
    """sync: whose trees they are; None as long as nothing was read, and after a failure."""

    def __init__(self) -> None:
        self.sync: SceneSync | None = None
        self._building: UpdateCommit | None = None

    def begin(
        self, sync: SceneSync, begin_update: Callable[[], UpdateCommit], *, to_the_end: bool = False
    ) -> SyncReport | None:
        """Has a scene read, and its trees built; the report if they are there at once, None if they are not yet.

        to_the_end: wait however long it takes. Raises what the engine raises.
        """
        self.sync = self._building = None  # a failed update must not leave what was there before
        building = begin_update()
        report = building.result() if to_the_end or building.wait(BUILDING_SECONDS) else None
        self.sync, self._building = sync, building if report is None else None
        return report

    def are_there(self, restart: Callable[[], object]) -> bool:
        """Whether there are trees of what was read last; if not, they are being built.

        restart: calls `begin`. Raises what the engine raises.
        """
        import perfect_bvh

        assert self.sync is not None
        building, self._building = self._building or self.sync.building, None
        if building is not None:
            if not building.wait(LOOKING_SECONDS):
                self._building = building
                return False
            try:
                building.result()
            except perfect_bvh.Cancelled:
                self._building = self.sync.building
            except BaseException:
                self.sync = None  # as after an update that fails at once
                raise
        if self._building is None and not self.sync.scene.is_current:
            restart()
        return self._building is None

    @property
    def is_building(self) -> bool:
        """Whether they were not there when they were looked for last."""
        return self._building is not None

    @property
    def is_over(self) -> bool:
        """Whether what was not there then has come since."""
        return self._building is not None and not self._building.is_running

    @property
    def state(self) -> str | None:
        """How far they are, as words for the user; None if nothing is being built."""
        return None if self._building is None else f"Building trees {self._building.share:.0%}"


# Scene reference -----------------------------------------------------------------------------------------------------
# A scene and a view layer of it, for work that goes on while Blender's user does.
#
# Between two steps an undo may replace all of Blender's data-blocks, and the user delete the scene or show another
# one in the window. So each step looks for the scene by what stays the same.


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
