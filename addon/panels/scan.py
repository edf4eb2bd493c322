"""What the Scan button casts, what becomes of the points, and the button."""

from __future__ import annotations

import bpy

from ..settings.point_color_items import OTHER
from ..statistics.messages import notes_of
from .common import TABS, SidebarPanel, draw_lines, draw_messages_of, settings_layout


class PERFECT_BVH_PT_scan(SidebarPanel, bpy.types.Panel):
    """From where which rays are cast, and what becomes of the points."""

    bl_label = "Scan"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        settings = context.scene.perfect_bvh.scan
        _draw_sensor(layout, settings)
        _draw_frames(layout, settings)
        _draw_points(layout, settings)
        _draw_files(context, layout, settings)
        layout.operator("perfect_bvh.scan", text="Start Scan", icon="OUTLINER_OB_POINTCLOUD")
        draw_messages_of(context, layout, "Scan")
        for note in notes_of(context.scene, "Scan"):
            draw_lines(context, layout, note, "INFO", TABS)


def _draw_sensor(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    layout.prop(settings, "pattern")
    column = layout.column(align=True)
    if settings.pattern == "CAMERA":
        column.prop(settings, "width")
        column.prop(settings, "height", text="Y")
    elif settings.pattern == "LIDAR":
        column.prop(settings, "elevations")
        column.prop(settings, "columns")
        column.prop(settings, "rate")
        column.prop(settings, "max_distance")
    elif settings.pattern == "FILE":
        column.prop(settings, "sensor_file")
    if settings.pattern not in ("CAMERA", "LIDAR"):  # which have no noise
        layout.prop(settings, "seed")
    layout.prop(settings, "sensor")
    layout.prop(settings, "mount")
    layout.prop(settings, "labels")
    layout.prop(settings, "use_viewport")


def _draw_frames(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    layout.prop(settings, "frames")
    column = layout.column(align=True)
    if settings.frames == "RANGE":
        column.prop(settings, "frame_start")
        column.prop(settings, "frame_end")
    if settings.frames != "CURRENT":
        column.prop(settings, "steps_per_frame")


def _draw_points(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    layout.prop(settings, "use_points")
    # Not grey where none are added: those of the last scan can be colored, too.
    column = layout.column(align=True)
    row = column.row(align=True)
    row.prop(settings, "point_color")
    row.operator("perfect_bvh.color_points", text="", icon="FILE_REFRESH")
    if settings.point_color == OTHER:
        column.prop(settings, "point_column")


def _draw_files(context: bpy.types.Context, layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    layout.prop(settings, "use_files")
    if not settings.use_files:
        return
    from ..scanning.formats import how_to_get  # here: it needs the engine, which may be missing

    column = layout.column(align=True)
    column.prop(settings, "folder")
    column.prop(settings, "file_format")
    missing = how_to_get(f".{settings.file_format}")
    if missing is not None:
        draw_lines(context, layout, missing, "ERROR", TABS)
    if settings.frames != "CURRENT":
        layout.prop(settings, "frames_per_file")
    layout.prop(settings, "use_resume")


CLASSES = (PERFECT_BVH_PT_scan,)
