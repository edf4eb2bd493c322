"""What the image shows, how it is computed, and Blender's own Simplify settings."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ..settings.denoisers import denoiser_in_use
from ..settings.modes import find_mode
from ..settings.preferences import native_error
from .common import RenderPanel, SubPanel, draw_lines, settings_layout


class PERFECT_BVH_PT_render(RenderPanel, bpy.types.Panel):
    """What the image shows and how many samples it takes."""

    bl_label = "Perfect BVH"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        error = native_error()
        if error is not None:
            box = layout.box()
            box.alert = True
            box.label(text="The engine cannot run", icon="ERROR")
            draw_lines(context, box, error)
            return
        scene = context.scene
        settings = scene.perfect_bvh
        column = layout.column(align=True)
        column.use_property_split = False
        column.operator("perfect_bvh.preview", icon="IMAGE_DATA")
        column.prop(settings, "preview_percentage", text="Size")
        layout.prop(settings, "mode")
        layout.prop(settings, "samples")
        if find_mode(settings.mode.lower()).offers_grey:
            layout.prop(settings, "use_material_colors")
        if settings.mode == "CLAY":
            layout.prop(settings, "ao_distance")
        _draw_view_hint(context, layout)


class PERFECT_BVH_PT_sampling(SubPanel, bpy.types.Panel):
    """How much work goes into images beside a render's samples, and what is done about the noise that is left."""

    bl_label = "Sampling"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        settings = context.scene.perfect_bvh
        _draw_threshold(layout, settings, "", "Noise Threshold")
        layout.prop(settings, "viewport_samples")
        _draw_threshold(layout, settings, "viewport_", "Viewport Noise")
        layout.prop(settings, "time_limit")
        layout.prop(settings, "seed")
        column = layout.column(heading="Denoise", align=True)
        column.active = find_mode(settings.mode.lower()).is_noisy
        column.prop(settings, "use_denoising", text="Render")
        column.prop(settings, "use_viewport_denoising", text="Viewport")
        draw_lines(context, column, f"by {denoiser_in_use()}")


class PERFECT_BVH_PT_film(SubPanel, bpy.types.Panel):
    """The background's alpha."""

    bl_label = "Film"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        layout.prop(context.scene.render, "film_transparent", text="Transparent")


class PERFECT_BVH_PT_performance(SubPanel, bpy.types.Panel):
    """Threads, and whether Blender keeps its evaluated scene from frame to frame."""

    bl_label = "Performance"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        render = context.scene.render
        layout.prop(render, "threads_mode")
        column = layout.column()
        column.enabled = render.threads_mode == "FIXED"
        column.prop(render, "threads")
        layout.prop(render, "use_persistent_data", text="Persistent Data")


class PERFECT_BVH_PT_simplify(RenderPanel, bpy.types.Panel):
    """Blender's own Simplify settings. Its panel would stand above this engine's, which come first everywhere else."""

    bl_label = "Simplify"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    draw_header = bpy.types.RENDER_PT_simplify.draw_header
    draw = bpy.types.RENDER_PT_simplify.draw


class PERFECT_BVH_PT_simplify_viewport(RenderPanel, bpy.types.Panel):
    """Simplify in viewports."""

    bl_label = "Viewport"
    bl_parent_id = "PERFECT_BVH_PT_simplify"

    draw = bpy.types.RENDER_PT_simplify_viewport.draw


class PERFECT_BVH_PT_simplify_render(RenderPanel, bpy.types.Panel):
    """Simplify in renders."""

    bl_label = "Render"
    bl_parent_id = "PERFECT_BVH_PT_simplify"

    draw = bpy.types.RENDER_PT_simplify_render.draw


def _draw_threshold(layout: bpy.types.UILayout, settings: bpy.types.bpy_struct, kind: str, heading: str) -> None:
    """A switch with its value beside it, as Cycles has it, and what counts only then. kind: of the properties."""
    column = layout.column()
    column.active = find_mode(settings.mode.lower()).is_noisy
    row = column.column(heading=heading, align=True).row(align=True)
    row.prop(settings, f"use_{kind}noise_threshold", text="")
    value, least = row.row(), column.row()
    value.active = least.active = getattr(settings, f"use_{kind}noise_threshold")
    value.prop(settings, f"{kind}noise_threshold", text="")
    least.prop(settings, f"{kind}min_samples", text="Min Samples")


def _draw_view_hint(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """Files of data modes bypass the scene's view transform; what the Image Editor shows does not."""
    scene = context.scene
    view_transform = find_mode(scene.perfect_bvh.mode.lower()).view
    if view_transform is not None and scene.view_settings.view_transform != view_transform:
        column = layout.column(align=True)
        draw_lines(context, column, f"Files use {view_transform}; the display uses:", icon="INFO")
        column.prop(scene.view_settings, "view_transform", text="View Transform")


CLASSES = (PERFECT_BVH_PT_render, PERFECT_BVH_PT_sampling, PERFECT_BVH_PT_film, PERFECT_BVH_PT_performance)
# After everything that belongs into the panel above.
LAST_CLASSES = (PERFECT_BVH_PT_simplify, PERFECT_BVH_PT_simplify_viewport, PERFECT_BVH_PT_simplify_render)
