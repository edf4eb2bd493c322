"""The Decay button: follows trees through the frames, and draws what they cost as curves over the viewport.

In a window it works in steps of a timer, what takes longer than a step goes on beside Blender, and Esc ends it with
what there is. Without one, or when a script calls it, it does the same in one go, and reports what it has found. The
current frame is shown again in the end.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, ClassVar

import bpy

from ..events.changes import edit_count
from ..live.scene_reference import SceneReference
from ..settings.editors import redraw_viewports
from ..settings.preferences import native_error
from ..settings.tree_settings import frames_of
from .compare import find_complaint, find_space
from .ticking import Ticking


class PERFECT_BVH_OT_decay(Ticking, bpy.types.Operator):
    """Steps through the frames in a timer."""

    bl_idname = "perfect_bvh.decay"
    bl_label = "Measure Decay"
    bl_description = (
        "Follow trees through the frames, and draw what they cost when they are only refitted, governed, and rebuilt"
    )
    bl_options: ClassVar = {"REGISTER"}

    # Blender evaluates these annotations, and what they are of needs the native engine.
    _decay: Any
    _steps: Generator[tuple[float, int], None, None]
    _place: SceneReference
    _frame: tuple[int, float]
    _space: int | None
    _row_count: int
    _edits: int

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        complaint = native_error() or _find_complaint(context)
        if complaint is not None:
            cls.poll_message_set(complaint)
        return complaint is None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        from ..view3d.decay import decay_view

        self._begin(context)
        if self._space is not None:
            decay_view.show(self._decay, self._space, self._edits)
        self._begin_ticking(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC":
            return self._finish(context, was_stopped=True)
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        step = self._step()
        if step is None:
            return self._finish(context)
        context.window_manager.progress_update(100 * step[0])
        self._tell(context, f"Following trees through frame {step[1]}: Esc ends it and shows what there is")
        self._show_rows()
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends or opens another file."""
        self._end(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        from ..view3d.decay import decay_view

        self._begin(context)
        while self._step() is not None:
            pass
        if self._space is not None and self._decay.rows:
            decay_view.show(self._decay, self._space, self._edits)
        return self._finish(context)

    # The parts -------------------------------------------------------------------------------------------------------

    def _begin(self, context: bpy.types.Context) -> None:
        from ..view3d.decay.decay import Decay, follow
        from ..view3d.reading import read_frames

        self._forget_complaints()
        scene = context.scene
        settings = scene.perfect_bvh.decay
        is_scene = settings.subject == "SCENE"
        context.evaluated_depsgraph_get()  # what was edited before is no edit since
        self._edits = edit_count(scene.session_uid)
        self._place = SceneReference("decay", scene, context.view_layer)
        self._frame = scene.frame_current, scene.frame_subframe
        self._space, self._row_count = find_space(context), 0
        obj = None if is_scene else context.object
        name = scene.name if obj is None else obj.name
        self._decay = Decay(name, scene.session_uid, is_scene, frames_of(scene))
        self._steps = follow(self._decay, read_frames(self._place, obj), settings.expected_rays)

    def _step(self) -> tuple[float, int] | None:
        """None at the end, and where it failed, with the reason reported."""
        import perfect_bvh

        try:
            return next(self._steps, None)
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            self._complain(problem)
            return None

    def _show_rows(self) -> None:
        """What there is more than when it was drawn last."""
        if len(self._decay.rows) > self._row_count:
            self._row_count = len(self._decay.rows)
            redraw_viewports()

    def _end(self, context: bpy.types.Context) -> None:
        self._steps.close()
        self._end_ticking(context)
        self._place.set_frame_back(*self._frame)

    def _finish(self, context: bpy.types.Context, *, was_stopped: bool = False) -> set[str]:
        from ..view3d.decay import decay_view
        from ..view3d.decay.decay_words import summary_of

        self._end(context)
        found = decay_view.shown()
        if not self._decay.rows:
            if found is not None and found.decay is self._decay:
                decay_view.hide()
            if was_stopped:
                self.report({"INFO"}, "Stopped before the first frame was measured")
            return {"CANCELLED"}
        redraw_viewports()
        self.report({"INFO"}, summary_of(self._decay))
        return {"FINISHED"}


class PERFECT_BVH_OT_end_decay(bpy.types.Operator):
    """Takes the curves off the viewport."""

    bl_idname = "perfect_bvh.end_decay"
    bl_label = "Close Decay"
    bl_description = "Take the curves off the viewport"
    bl_options: ClassVar = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if native_error() is not None or not _is_shown():
            cls.poll_message_set("No curves are shown")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        from ..view3d.decay import decay_view

        decay_view.hide()
        return {"FINISHED"}


def _find_complaint(context: bpy.types.Context) -> str | None:
    """Why there is nothing to follow."""
    screen = context.screen
    if screen is not None and screen.is_animation_playing:
        return "Stop the animation first"
    if not len(frames_of(context.scene)):
        return "The last frame to follow is before the first"
    return find_complaint(context) if context.scene.perfect_bvh.decay.subject == "OBJECT" else None


def _is_shown() -> bool:
    from ..view3d.decay import decay_view

    return decay_view.shown() is not None


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_OT_decay)
    bpy.utils.register_class(PERFECT_BVH_OT_end_decay)


def unregister() -> None:
    bpy.utils.unregister_class(PERFECT_BVH_OT_end_decay)
    bpy.utils.unregister_class(PERFECT_BVH_OT_decay)
