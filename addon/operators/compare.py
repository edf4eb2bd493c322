"""The Compare button: two trees of the active object side by side in the viewport that it was pressed in.

In a window trees are built and measured beside Blender, and Esc gives that up. Without one, or when a script calls it,
it does the same in one go, and reports what it has found.
"""

from __future__ import annotations

from functools import partial
from typing import Any, ClassVar

import bpy

from ..events.changes import edit_count
from ..settings.tree_settings import REFITTED, choice_of
from .ticking import Checked, Ticking

SHAPES = ("MESH", "CURVE", "CURVES", "SURFACE", "FONT", "META", "POINTCLOUD", "VOLUME")


class PERFECT_BVH_OT_compare(Ticking, bpy.types.Operator):
    """Waits in a timer for what is built and measured beside it."""

    bl_idname = "perfect_bvh.compare"
    bl_label = "Compare"
    bl_description = "Build two trees of the active object, and show them side by side with what they cost"
    bl_options: ClassVar = {"REGISTER"}

    # Blender evaluates these annotations, and what they are of needs the native engine.
    _work: Any
    _space: int | None
    _edits: int

    @classmethod
    def _find_complaint(cls, context: bpy.types.Context) -> str | None:
        return find_complaint(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        return self._finish(context) if self._begin(context) else {"CANCELLED"}

    # The parts -------------------------------------------------------------------------------------------------------

    def _begin(self, context: bpy.types.Context) -> bool:
        """False if there is nothing to compare, with the reason reported."""
        from ..support.background_work import BackgroundWork
        from ..view3d.compare.compare_trees import compare
        from ..view3d.reading import read_object

        scene, settings = context.scene, context.scene.perfect_bvh.compare
        choices = choice_of(settings.left), choice_of(settings.right)
        self._forget_complaints()
        self._space = find_space(context)
        context.evaluated_depsgraph_get()  # what was edited before is no edit since
        self._edits = edit_count(scene.session_uid)
        try:
            shown = read_object(context, context.object)
            is_refitted = any(choice.identifier == REFITTED for choice in choices)
            first = read_object(context, context.object, scene.frame_start) if is_refitted else None
        except ValueError as problem:
            self._complain(problem)
            return False
        self._work = BackgroundWork(
            partial(compare, shown, scene.frame_current, choices, first), lambda comparison: comparison
        )
        return True

    def _tick(self, context: bpy.types.Context) -> set[str] | None:
        if self._work.is_running:
            context.window_manager.progress_update(100 * self._work.share)
            self._tell(context, f"Comparing trees {self._work.share:.0%}: Esc stops it")
            return None
        self._end(context)
        return self._finish(context)

    def _stopped(self) -> str:
        return "Comparing was stopped"

    def _finish(self, context: bpy.types.Context) -> set[str]:
        import perfect_bvh

        from ..view3d.compare import compare_view

        try:
            comparison = self._work.result()
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            self._complain(problem)
            return {"CANCELLED"}
        if self._space is not None:
            compare_view.show(comparison, context.scene, self._space, self._edits)
        left, right = comparison.left, comparison.right
        self.report({"INFO"}, f"SAH: {left.label} {left.sah:,.1f}, {right.label} {right.sah:,.1f}")
        return {"FINISHED"}

    def _end(self, context: bpy.types.Context) -> None:
        self._work.stop()
        self._end_ticking(context)


class PERFECT_BVH_OT_end_comparison(Checked, bpy.types.Operator):
    """Shows the scene again."""

    bl_idname = "perfect_bvh.end_comparison"
    bl_label = "End Comparison"
    bl_description = "Show the scene again instead of the two trees"
    bl_options: ClassVar = {"INTERNAL"}

    @classmethod
    def _find_complaint(cls, context: bpy.types.Context) -> str | None:
        from ..view3d.compare import compare_view

        return "No trees are compared" if compare_view.shown() is None else None

    def execute(self, context: bpy.types.Context) -> set[str]:
        from ..view3d.compare import compare_view

        compare_view.hide()
        return {"FINISHED"}


def find_complaint(context: bpy.types.Context) -> str | None:
    """Why the tree of the active object cannot be looked into."""
    if context.object is None:
        return "There is no active object"
    if context.object.type not in SHAPES and context.object.instance_type == "NONE":
        return "The active object has no triangles that rays could meet"
    if context.mode != "OBJECT":
        return "Leave the mode of the active object first: its triangles are those of Object Mode"
    return None


def find_space(context: bpy.types.Context) -> int | None:
    """The address of the 3D viewport that a button was pressed in, or else of the largest; None if there is none.

    Areas come and go when they are maximized, their spaces stay.
    """
    area = context.area
    if area is None or area.type != "VIEW_3D":
        areas = [] if context.window is None else context.window.screen.areas
        viewports = [area for area in areas if area.type == "VIEW_3D"]
        area = max(viewports, key=lambda area: area.width * area.height, default=None)
    return None if area is None else area.spaces.active.as_pointer()


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_OT_compare)
    bpy.utils.register_class(PERFECT_BVH_OT_end_comparison)


def unregister() -> None:
    bpy.utils.unregister_class(PERFECT_BVH_OT_end_comparison)
    bpy.utils.unregister_class(PERFECT_BVH_OT_compare)
