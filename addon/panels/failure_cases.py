"""Scenes to learn from."""

from __future__ import annotations

import bpy

from .common import SubPanel, draw_lines


class PERFECT_BVH_PT_failure_cases(SubPanel, bpy.types.Panel):
    """Scenes to learn from."""

    bl_label = "Failure Cases"

    def draw(self, context: bpy.types.Context) -> None:
        draw_lines(context, self.layout, "Scenes on which usual methods fail")
        self.layout.operator_menu_enum("perfect_bvh.add_failure_case", "case", icon="SCENE_DATA")


CLASSES = (PERFECT_BVH_PT_failure_cases,)
