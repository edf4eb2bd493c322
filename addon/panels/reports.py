"""What was done last for the scene, mesh by mesh, and what it cost."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from ..statistics.last_result import is_outdated, last_statistics
from ..statistics.summary import PlanRow, count_meshes, plan_rows, statistics_rows
from ..statistics.words import duration, memory
from .common import EnginePanel, RenderPanel, draw_lines

SHOWN_WARNINGS = 3


class PERFECT_BVH_PT_statistics(RenderPanel, bpy.types.Panel):
    """How long each step of the last render, preview or view of this scene took, and what it was done to."""

    bl_label = "Statistics"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and last_statistics(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        statistics = last_statistics(context.scene)
        is_old = is_outdated(context.scene)
        split = self.layout.split(factor=0.4)
        split.active = not is_old
        names, values = split.column(align=True), split.column(align=True)
        names.alignment = "RIGHT"
        for name, value in statistics_rows(statistics):
            names.label(text=name)
            values.label(text=value)
        _draw_warnings(context, self.layout, (*statistics.report.warnings, *statistics.complaints))
        # A viewport renews them itself: panels would only jump meanwhile.
        if is_old and statistics.source != "Viewport":
            draw_lines(context, self.layout, "The scene has changed since", icon="INFO")


class PERFECT_BVH_PT_plan(EnginePanel, bpy.types.Panel):
    """What was done last with each mesh's tree, and why; first those that cost the camera rays most."""

    bl_label = "Plan"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and last_statistics(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        statistics = last_statistics(context.scene)
        report = statistics.report
        rows = plan_rows(report, statistics.mesh_costs)
        for row in rows:
            _draw_row(context, self.layout, row)
        more = count_meshes(report) + len(report.unseen) - len(rows)
        if more > 0:
            self.layout.label(text=f"and {more:,} more meshes")


def _draw_warnings(context: bpy.types.Context, layout: bpy.types.UILayout, warnings: Sequence[str]) -> None:
    """What could not be read: reports of it are seen for a few seconds only."""
    for warning in warnings[:SHOWN_WARNINGS]:
        draw_lines(context, layout, warning, icon="ERROR")
    more = len(warnings) - SHOWN_WARNINGS
    if more > 0:
        draw_lines(context, layout, f"and {more:,} more: see the Info editor", icon="BLANK1")


def _draw_row(context: bpy.types.Context, layout: bpy.types.UILayout, row: PlanRow) -> None:
    column = layout.box().column(align=True)
    button = column.operator("perfect_bvh.select_mesh", text=row.name, icon="RESTRICT_SELECT_OFF")
    button.source, button.session_uid = row.source, row.session_uid
    size = f", {memory(row.byte_count)}" if row.byte_count else ""
    if row.triangle_count:
        draw_lines(context, column, f"{row.triangle_count:,} triangle{'s' * (row.triangle_count > 1)}{size}")
    if row.ray_share > 0.0:
        draw_lines(context, column, f"{row.ray_share:.1%} of the camera rays' work")
    draw_lines(context, column, f"{row.usage.capitalize()}: {row.usage_reason}")
    done = f"{row.action}, {row.builder}, {duration(row.milliseconds)}" if row.builder else row.action
    draw_lines(context, column, f"{done[0].upper()}{done[1:]}: {row.reason}")


CLASSES = (PERFECT_BVH_PT_statistics, PERFECT_BVH_PT_plan)
