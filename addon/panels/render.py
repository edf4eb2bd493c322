"""The panels of the render properties: the engine's own, sampling, light paths, curves and motion blur."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ..settings.modes import find_mode, mode_of_render
from ..settings.preferences import denoiser_in_use, native_error
from ..settings.scene_settings import light_path_settings, rolling_shutter_settings
from ..view3d.rendered import opening
from .common import EnginePanel, RenderPanel, draw_lines, draw_props, settings_layout

# The mode of the image, its background, threads, and Blender's own Simplify settings.


class PERFECT_BVH_PT_render(RenderPanel, bpy.types.Panel):
    """The mode of the image, directly below the choice of the engine, like Cycles' device."""

    bl_label = "Perfect BVH"
    bl_options: ClassVar = {"HIDE_HEADER"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        error = native_error()
        if error is not None:
            box = layout.box()
            box.alert = True
            box.label(text="The engine cannot run", icon="ERROR")
            draw_lines(context, box, error)
            return
        settings = context.scene.perfect_bvh
        layout.prop(settings, "mode")
        if find_mode(settings.mode.lower()).offers_grey:
            layout.prop(settings, "use_material_colors")
        if settings.mode == "CLAY":
            layout.prop(settings, "ao_distance")
        _draw_view_hint(context, layout)
        column = layout.column(align=True)
        column.operator("perfect_bvh.preview", icon="RENDER_STILL")
        column.prop(settings, "preview_percentage", text="Size")


class PERFECT_BVH_PT_film(EnginePanel, bpy.types.Panel):
    """The background's alpha."""

    bl_label = "Film"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        layout.prop(context.scene.render, "film_transparent", text="Transparent")


class PERFECT_BVH_PT_performance(EnginePanel, bpy.types.Panel):
    """Threads, and whether Blender keeps its evaluated scene from frame to frame."""

    bl_label = "Performance"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        render = context.scene.render
        layout.prop(render, "threads_mode")
        column = layout.column()
        column.enabled = render.threads_mode == "FIXED"
        column.prop(render, "threads")
        layout.column(heading="Persistent").prop(render, "use_persistent_data", text="Data")


class PERFECT_BVH_PT_performance_viewport(EnginePanel, bpy.types.Panel):
    """The shading of viewports when the file is opened."""

    bl_label = "Viewport"
    bl_parent_id = "PERFECT_BVH_PT_performance"
    bl_options: ClassVar = set()

    def draw(self, context: bpy.types.Context) -> None:
        settings_layout(self).prop(context.screen, opening.PROPERTY, text="Start in Rendered View")


class PERFECT_BVH_PT_simplify(RenderPanel, bpy.types.Panel):
    """Blender's own Simplify settings. Blender's panel would come before this engine's panels."""

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


def _draw_view_hint(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """Explains that files of data modes bypass the scene's view transform, while the Image Editor applies it."""
    scene = context.scene
    view_transform = mode_of_render(scene).view
    if view_transform is not None and scene.view_settings.view_transform != view_transform:
        column = layout.column(align=True)
        draw_lines(context, column, f"Files use {view_transform}; the display uses:", icon="INFO")
        column.prop(scene.view_settings, "view_transform", text="View Transform")


# Sampling ------------------------------------------------------------------------------------------------------------
# The amount of work for images, and the treatment of the remaining noise: in Cycles' layout.


NO_OIDN = "OpenImageDenoise is missing; a built-in filter leaves more noise. The Blender from blender.org includes it"


class PERFECT_BVH_PT_sampling(EnginePanel, bpy.types.Panel):
    """Holds the panels of viewports and of renders; says once if the usual denoiser is missing."""

    bl_label = "Sampling"
    bl_options: ClassVar = set()

    def draw(self, context: bpy.types.Context) -> None:
        if _is_noisy(context.scene.perfect_bvh) and not _has_oidn():
            draw_lines(context, self.layout, NO_OIDN, icon="INFO")


class PERFECT_BVH_PT_sampling_viewport(EnginePanel, bpy.types.Panel):
    """The sampling of Rendered viewports."""

    bl_label = "Viewport"
    bl_parent_id = "PERFECT_BVH_PT_sampling"
    bl_options: ClassVar = set()

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        settings = context.scene.perfect_bvh
        _draw_samples(layout, settings, "viewport_")
        _draw_denoising(layout, settings, "use_viewport_denoising")


class PERFECT_BVH_PT_sampling_render(EnginePanel, bpy.types.Panel):
    """The sampling of renders, and of views that are rendered to an image."""

    bl_label = "Render"
    bl_parent_id = "PERFECT_BVH_PT_sampling"
    bl_options: ClassVar = set()

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        settings = context.scene.perfect_bvh
        _draw_samples(layout, settings, "")
        layout.prop(settings, "time_limit")
        _draw_denoising(layout, settings, "use_denoising")


class PERFECT_BVH_PT_sampling_advanced(EnginePanel, bpy.types.Panel):
    """Rarely changed settings of the sampling."""

    bl_label = "Advanced"
    bl_parent_id = "PERFECT_BVH_PT_sampling"

    def draw(self, context: bpy.types.Context) -> None:
        settings_layout(self).prop(context.scene.perfect_bvh, "seed")


def _draw_samples(layout: bpy.types.UILayout, settings: bpy.types.bpy_struct, kind: str) -> None:
    """Draws the threshold with its switch, and the settings that depend on it. kind: the properties' prefix."""
    is_noisy, is_adaptive = _is_noisy(settings), getattr(settings, f"use_{kind}noise_threshold")
    row = layout.column(heading="Noise Threshold", align=True).row(align=True)
    row.active = is_noisy
    row.prop(settings, f"use_{kind}noise_threshold", text="")
    value = row.row()
    value.active = is_adaptive
    value.prop(settings, f"{kind}noise_threshold", text="")
    column = layout.column(align=True)
    _draw_max(column, settings, kind, "Max Samples" if is_noisy and is_adaptive else "Samples")
    if is_adaptive and not kind:
        least = column.row()
        least.active = is_noisy
        least.prop(settings, f"{kind}min_samples", text="Min Samples")


def _draw_max(layout: bpy.types.UILayout, settings: bpy.types.bpy_struct, kind: str, name: str) -> None:
    """Draws the maximum of viewports: that of renders, or a separate number."""
    if not kind:
        layout.prop(settings, "samples", text=name)
        return
    layout.column(heading=name, align=True).prop(settings, "use_render_samples", text="Same as Render")
    if not settings.use_render_samples:
        layout.prop(settings, "viewport_samples", text=" ")


def _draw_denoising(layout: bpy.types.UILayout, settings: bpy.types.bpy_struct, name: str) -> None:
    """A switch that says by what."""
    column = layout.column(heading="Denoise")
    column.active = _is_noisy(settings)
    column.prop(settings, name, text=denoiser_in_use() if _has_oidn() else "Built-in Filter")


def _has_oidn() -> bool:
    return denoiser_in_use().startswith("OpenImageDenoise")


def _is_noisy(settings: bpy.types.bpy_struct) -> bool:
    return find_mode(settings.mode.lower()).is_noisy


# Light paths ---------------------------------------------------------------------------------------------------------
# How far light bounces. Cycles keeps these settings in the file, and both engines follow them.


CYCLES_IS_OFF = "Enable the add-on Cycles Render Engine: it keeps these settings. Without it they have their defaults"


class LightPathsPanel(EnginePanel):
    """A panel below Light Paths; hidden if there is nothing to set."""

    bl_parent_id = "PERFECT_BVH_PT_light_paths"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and light_path_settings(context.scene) is not None


class PERFECT_BVH_PT_light_paths(EnginePanel, bpy.types.Panel):
    """The parent of these panels; says if there is nothing to set."""

    bl_label = "Light Paths"

    def draw(self, context: bpy.types.Context) -> None:
        if light_path_settings(context.scene) is None:
            draw_lines(context, self.layout, CYCLES_IS_OFF, icon="INFO")


class PERFECT_BVH_PT_light_paths_bounces(LightPathsPanel, bpy.types.Panel):
    """The limits of light bounces for each kind of surface."""

    bl_label = "Max Bounces"
    bl_options: ClassVar = set()

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = _light_paths_layout(self, context), light_path_settings(context.scene)
        layout.prop(settings, "max_bounces", text="Total")
        texts = {"diffuse_bounces": "Diffuse", "glossy_bounces": "Glossy", "transmission_bounces": "Transmission"}
        draw_props(layout.column(align=True), settings, **texts)
        layout.prop(settings, "transparent_max_bounces", text="Transparent")


class PERFECT_BVH_PT_light_paths_clamping(LightPathsPanel, bpy.types.Panel):
    """The limits of the brightness of a sample."""

    bl_label = "Clamping"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = _light_paths_layout(self, context), light_path_settings(context.scene)
        texts = {"sample_clamp_direct": "Direct", "sample_clamp_indirect": "Indirect"}
        draw_props(layout.column(align=True), settings, **texts)


class PERFECT_BVH_PT_light_paths_caustics(LightPathsPanel, bpy.types.Panel):
    """Light on matt surfaces that comes from mirrors and glass."""

    bl_label = "Caustics"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = _light_paths_layout(self, context), light_path_settings(context.scene)
        layout.prop(settings, "blur_glossy")
        column = layout.column(heading="Caustics", align=True)
        draw_props(column, settings, caustics_reflective="Reflective", caustics_refractive="Refractive")


def _light_paths_layout(panel: bpy.types.Panel, context: bpy.types.Context) -> bpy.types.UILayout:
    """Greyed out in modes without light that bounces."""
    layout = settings_layout(panel)
    layout.active = mode_of_render(context.scene).shading
    return layout


# Hair ----------------------------------------------------------------------------------------------------------------
# What hair is: Cycles' settings, which this engine follows, or those of EEVEE where Cycles is off.


class PERFECT_BVH_PT_hair(EnginePanel, bpy.types.Panel):
    """The settings of curves, in Cycles' layout."""

    bl_label = "Curves"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        column = settings_layout(self).column()
        cycles = getattr(context.scene, "cycles_curves", None)
        if cycles is None:
            column.prop(context.scene.render, "hair_type", text="Shape")
            return
        column.prop(cycles, "shape")
        subdivisions = column.column()
        subdivisions.active = cycles.shape == "RIBBONS"
        subdivisions.prop(cycles, "subdivisions", text="Curve Subdivisions")


# Motion blur ---------------------------------------------------------------------------------------------------------
# Motion blur: Blender's own settings, and those that Cycles keeps in the file, which both engines follow.


def motion_blur_layout(panel: bpy.types.Panel, context: bpy.types.Context) -> bpy.types.UILayout:
    """Greyed out where nothing is blurred."""
    layout = settings_layout(panel)
    scene = context.scene
    layout.active = scene.render.use_motion_blur and mode_of_render(scene).has_bounces
    return layout


class PERFECT_BVH_PT_motion_blur(EnginePanel, bpy.types.Panel):
    """The position and duration of the shutter."""

    bl_label = "Motion Blur"

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context: bpy.types.Context) -> None:
        layout, render = motion_blur_layout(self, context), context.scene.render
        column = layout.column()
        column.prop(render, "motion_blur_position", text="Position")
        column.prop(render, "motion_blur_shutter")
        settings = rolling_shutter_settings(context.scene)
        if settings is not None:
            column.prop(settings, "rolling_shutter_type")
            duration = column.column()
            duration.active = settings.rolling_shutter_type != "NONE"
            duration.prop(settings, "rolling_shutter_duration", text="Duration")


class PERFECT_BVH_PT_motion_blur_curve(EnginePanel, bpy.types.Panel):
    """The opening of the shutter over time."""

    bl_label = "Shutter Curve"
    bl_parent_id = "PERFECT_BVH_PT_motion_blur"

    def draw(self, context: bpy.types.Context) -> None:
        layout, render = motion_blur_layout(self, context), context.scene.render
        layout.use_property_split = False
        layout.template_curve_mapping(render, "motion_blur_shutter_curve")
