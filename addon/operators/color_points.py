"""Colours the points of scans by another column: these are their attributes, so that nothing is scanned again."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ..statistics.words import sentence
from .ticking import Checked


class PERFECT_BVH_OT_color_points(Checked, bpy.types.Operator):
    """Writes the points' attribute of colours anew."""

    bl_idname = "perfect_bvh.color_points"
    bl_label = "Color Points"
    bl_description = "Color the points of the selected scans as chosen, or of the last one if none is selected"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def _find_complaint(cls, context: bpy.types.Context) -> str | None:
        """Why no points can be coloured; asked in each redraw, where all objects cannot be gone through."""
        from ..scanning.point_data import may_have_points

        if context.mode != "OBJECT":
            return "Points can be colored in Object Mode only"
        return None if may_have_points() else "There is no scan whose points could be colored"

    def execute(self, context: bpy.types.Context) -> set[str]:
        from ..scanning.point_data import color_points

        settings = context.scene.perfect_bvh.scan
        scans, colored = _chosen(context), []
        if not scans:
            self.report({"ERROR"}, "There is no scan in this view layer whose points could be colored")
        for scan in scans:
            try:
                color_points(scan.data, settings.point_color, settings.point_column)
            except ValueError as problem:
                self.report({"ERROR"}, sentence(str(problem).removeprefix("color_points: ")))
            else:
                colored.append(scan.name)
        if not colored:
            return {"CANCELLED"}
        self.report({"INFO"}, f"{', '.join(colored)}: points are colored anew")
        return {"FINISHED"}


def _chosen(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The selected scans; where none is selected, the one whose points were made last."""
    from ..extract.scans import has_points  # here: it needs the engine, which may be missing

    scans = [obj for obj in context.view_layer.objects if has_points(obj) and obj.data.is_editable]
    selected = [scan for scan in scans if scan.select_get()]
    return selected or sorted(scans, key=lambda scan: scan.data.session_uid)[-1:]


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_OT_color_points)


def unregister() -> None:
    bpy.utils.unregister_class(PERFECT_BVH_OT_color_points)
