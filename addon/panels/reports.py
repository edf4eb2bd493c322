"""What the last render did, mesh by mesh, and what it cost."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ..engine import last_statistics
from ..summary import count_meshes, plan_rows, statistics_rows
from .common import RenderPanel, draw_lines


class PERFECT_BVH_PT_statistics(RenderPanel, bpy.types.Panel):
    """How long each step of the last render of this scene took, and what it was done to."""

    bl_label = "Statistics"
    bl_parent_id = "PERFECT_BVH_PT_render"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and last_statistics(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        statistics = last_statistics(context.scene)
        split = self.layout.split(factor=0.4)
        names, values = split.column(align=True), split.column(align=True)
        names.alignment = "RIGHT"
        for name, value in statistics_rows(statistics):
            names.label(text=name)
            values.label(text=value)


class PERFECT_BVH_PT_plan(RenderPanel, bpy.types.Panel):
    """What the last render did with each mesh's tree, and why."""

    bl_label = "Plan"
    bl_parent_id = "PERFECT_BVH_PT_render"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and last_statistics(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        report = last_statistics(context.scene).report
        rows = plan_rows(report)
        for row in rows:
            column = self.layout.box().column(align=True)
            column.label(text=f"{row.name}: {row.triangle_count:,} triangles", icon="MESH_DATA")
            done = f"{row.action}, {row.builder}, {row.milliseconds:.1f} ms" if row.builder else row.action
            draw_lines(context, column, f"{row.usage}: {row.usage_reason}")
            draw_lines(context, column, f"{done}: {row.reason}")
        more = count_meshes(report) - len(rows)
        if more > 0:
            self.layout.label(text=f"and {more:,} more meshes")


CLASSES = (PERFECT_BVH_PT_statistics, PERFECT_BVH_PT_plan)
