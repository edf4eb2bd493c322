"""The button that measures the scene."""

from __future__ import annotations

import bpy

from .common import SubPanel, draw_lines


class PERFECT_BVH_PT_bench(SubPanel, bpy.types.Panel):
    """Measures the scene and shows what that has found."""

    bl_label = "Bench"

    def draw(self, context: bpy.types.Context) -> None:
        text = "Measures builders, layouts and policies on this scene for about a minute"
        draw_lines(context, self.layout, text)
        self.layout.operator("perfect_bvh.bench", icon="TIME")


CLASSES = (PERFECT_BVH_PT_bench,)
