"""The button that measures the scene."""

from __future__ import annotations

from typing import ClassVar

import bpy

from .common import RenderPanel, draw_lines


class PERFECT_BVH_PT_bench(RenderPanel, bpy.types.Panel):
    """Measures the scene and shows what that has found."""

    bl_label = "Bench"
    bl_parent_id = "PERFECT_BVH_PT_render"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        text = "Measures builders, layouts, precisions and policies on this scene for about a minute"
        draw_lines(context, self.layout, text)
        self.layout.operator("perfect_bvh.bench", icon="TIME")


CLASSES = (PERFECT_BVH_PT_bench,)
