"""The panels of outputs other than the picture: a view layer's passes, scans, labels and bakes."""

from __future__ import annotations

from typing import Any, ClassVar

import bpy

from ..settings.bake_settings import options_of, sun_position_of
from ..settings.modes import mode_of_render
from ..settings.preferences import denoising_data_settings
from ..settings.scan_choices import FORMATS, OTHER
from ..support.files import how_to_get
from .common import (
    TABS,
    RenderPanel,
    SidebarPanel,
    draw_command,
    draw_lines,
    draw_main_button,
    draw_messages_of,
    draw_props,
    draw_purpose,
    settings_layout,
)

# The settings of the Scan button's sensor and of its points, and the button.


class PERFECT_BVH_PT_scan(SidebarPanel, bpy.types.Panel):
    """The sensor, its object, and the output of the points."""

    bl_label = "Scan"
    page = "blender#the-sidebars-tab-perfect-bvh-scan-label-and-bake"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        draw_purpose(context, layout, "Cast the rays of a camera or a LiDAR, and save their hits as points or files")
        settings = context.scene.perfect_bvh.scan
        _draw_sensor(layout, settings)
        _draw_frames(layout, settings)
        _draw_points(layout, settings)
        _draw_files(context, layout, settings)
        draw_main_button(context, layout, "perfect_bvh.scan", "Start Scan", "OUTLINER_OB_POINTCLOUD")
        draw_messages_of(context, layout, "Scan")


def _draw_sensor(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    layout.prop(settings, "pattern")
    column = layout.column(align=True)
    if settings.pattern == "CAMERA":
        draw_props(column, settings, "width", height="Y")
    elif settings.pattern == "LIDAR":
        draw_props(column, settings, "elevations", "columns", "rate", "max_distance")
    elif settings.pattern == "FILE":
        column.prop(settings, "sensor_file")
    if settings.pattern not in ("CAMERA", "LIDAR"):  # which have no noise
        layout.prop(settings, "seed")
    column = layout.column(align=True)
    column.prop(settings, "sensor", placeholder="Scene Camera")
    column.operator("perfect_bvh.add_sensor", icon="ADD")
    draw_props(layout, settings, "mount", "labels", "use_viewport")


def _draw_frames(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    layout.prop(settings, "frames")
    column = layout.column(align=True)
    if settings.frames == "RANGE":
        draw_props(column, settings, "frame_start", "frame_end")
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
    column = layout.column(align=True)
    draw_props(column, settings, "folder", "file_format")
    if settings.file_format == "kitti":
        column.prop(settings, "category")
    elif FORMATS[f".{settings.file_format}"].has_boxes:
        column.prop(settings, "use_boxes")
    modules = FORMATS[f".{settings.file_format}"].modules
    _draw_missing(context, layout, f"{settings.file_format.upper()} files", *modules)
    if settings.frames != "CURRENT":
        layout.prop(settings, "frames_per_file")
    layout.prop(settings, "use_resume")


def _draw_missing(context: bpy.types.Context, layout: bpy.types.UILayout, what: str, *modules: str) -> None:
    """Says before the work which libraries are missing."""
    missing = how_to_get(what, *modules)
    if missing is not None:
        draw_lines(context, layout, missing, "ERROR", TABS)
        draw_command(layout, missing)


PNG_LOOKS = "PNG files hold numbers and look black in viewers. Files that end in .colors.png show their ids in colors"


class PERFECT_BVH_PT_label_images(SidebarPanel, bpy.types.Panel):
    """The settings and the button of label images."""

    bl_label = "Label Images"
    page = "how_to/label_images"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        draw_purpose(context, layout, "Images of the object, category and depth of each pixel, as training data")
        settings = context.scene.perfect_bvh.label_images
        layout.prop(settings, "camera", placeholder="Scene Camera")
        layout.prop(settings, "frames")
        column = layout.column(align=True)
        if settings.frames == "RANGE":
            draw_props(column, settings, "frame_start", "frame_end")
        layout.prop(settings, "use_render_size")
        if not settings.use_render_size:
            draw_props(layout.column(align=True), settings, "width", height="Y")
        draw_props(layout, settings, "category", "layers")
        layout.column(align=True).prop(settings, "formats")
        if "png" in settings.formats:
            draw_lines(context, layout, PNG_LOOKS, "INFO", TABS)
        if "exr" in settings.formats:
            _draw_missing(context, layout, "EXR files", "OpenEXR")
        draw_props(layout, settings, "use_coco", "folder", "use_resume")
        draw_main_button(context, layout, "perfect_bvh.label_images", "Start Labelling", "IMAGE_DATA")
        draw_messages_of(context, layout, "Label Images")


POINT_AT_FACES = "Point at a face to see its number"


class PERFECT_BVH_PT_bake_rays(SidebarPanel, bpy.types.Panel):
    """What is baked onto the selected meshes, and the button."""

    bl_label = "Bake Sun, Sky and Thickness"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}
    page = "how_to/sun_hours"

    def draw(self, context: bpy.types.Context) -> None:
        from ..view3d.baked_view import sections

        layout = settings_layout(self)
        draw_purpose(
            context, layout, "What each face of the selected meshes sees: hours of sun, sky, or its surroundings"
        )
        settings = context.scene.perfect_bvh.bake
        draw_props(layout, settings, "kind", "domain")
        if settings.domain == "TEXEL":
            layout.prop(settings, "uv_map", placeholder="Active")
            draw_props(layout.column(align=True), settings, "width", "height", "margin")
        if settings.kind == "SUN_HOURS":
            _draw_sun(layout, settings, sun_position_of(context.scene))
        for name in options_of(settings):
            layout.prop(settings, name, **({"placeholder": "Scene Camera"} if name == "viewers" else {}))
        if settings.kind == "EXPOSURE":
            layout.prop(settings, "use_frames")
        layout.prop(settings, "table", placeholder=".csv or .parquet")
        draw_main_button(context, layout, "perfect_bvh.bake_rays", "Bake", "RENDER_STILL")
        draw_messages_of(context, layout, self.bl_label)
        if sections(context):
            draw_lines(context, layout, POINT_AT_FACES, "INFO", TABS)


def _draw_sun(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup, other: Any) -> None:
    """other: the add-on Sun Position's settings, which are used where it has them."""
    layout.prop(settings, "light")
    dates = settings if other is None or settings.period == "RANGE" else other
    column = layout.column(align=True)
    column.prop(settings, "period")
    column.prop(dates, "year")
    if settings.period != "YEAR":
        draw_props(column, dates, "month", "day")
    if settings.period == "RANGE":
        column = layout.column(align=True)
        column.prop(settings, "month_end", text="To Month")
        column.prop(settings, "day_end")
    if settings.light == "WEATHER":
        layout.prop(settings, "weather")
    else:
        layout.prop(settings, "step")
        place = settings if other is None else other
        column = layout.column(align=True)
        draw_props(column, place, "latitude", "longitude")
        if other is None:
            column.prop(settings, "zone", placeholder="From the longitude")
        else:
            draw_props(column, other, "UTC_zone", "use_daylight_savings")
    layout.prop(*((settings, "north") if other is None else (other, "north_offset")))


# View layer ----------------------------------------------------------------------------------------------------------
# The passes that the engine writes in addition to Combined.


class PERFECT_BVH_PT_passes(RenderPanel, bpy.types.Panel):
    """The passes that the engine writes in addition to Combined."""

    bl_label = "Data"
    bl_context = "view_layer"
    bl_parent_id = "VIEWLAYER_PT_layer_passes"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        view_layer = context.view_layer
        column = layout.column(heading="Include", align=True)
        draw_props(column, view_layer, "use_pass_z", "use_pass_normal")
        vector = column.column()
        vector.active = not context.scene.render.use_motion_blur
        vector.prop(view_layer, "use_pass_vector")
        column = layout.column(heading="Indexes", align=True)
        draw_props(column, view_layer, use_pass_object_index="Object", use_pass_material_index="Material")
        threshold = layout.column()
        threshold.active = mode_of_render(context.scene).shading
        threshold.prop(view_layer, "pass_alpha_threshold")
        denoising = denoising_data_settings(view_layer)
        if denoising is not None:
            layout.column(heading="Denoising").prop(denoising, "denoising_store_passes", text="Data")


class PERFECT_BVH_PT_filter(RenderPanel, bpy.types.Panel):
    """The parts of the scene that a view layer can leave out."""

    bl_label = "Filter"
    bl_context = "view_layer"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        column = settings_layout(self).column(heading="Include")
        column.active = context.scene.render.use_motion_blur
        column.prop(context.view_layer, "use_motion_blur", text="Motion Blur")


class PERFECT_BVH_PT_override(RenderPanel, bpy.types.Panel):
    """The view layer's overrides, which Blender before 5.0 shows with its own engines only."""

    bl_label = "Override"
    bl_context = "view_layer"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings_layout(self).prop(context.view_layer, "material_override")


HAS_OVERRIDE = hasattr(bpy.types, "VIEWLAYER_PT_override")
