"""How much work goes into images, and what is done about the noise that is left: laid out as Cycles has it."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ..settings.denoisers import denoiser_in_use
from ..settings.modes import find_mode
from .common import EnginePanel, settings_layout


class PERFECT_BVH_PT_sampling(EnginePanel, bpy.types.Panel):
    """Holds the panels of viewports and of renders."""

    bl_label = "Sampling"
    bl_options: ClassVar = set()

    def draw(self, context: bpy.types.Context) -> None:
        """Nothing of its own."""


class PERFECT_BVH_PT_sampling_viewport(EnginePanel, bpy.types.Panel):
    """Of Rendered viewports."""

    bl_label = "Viewport"
    bl_parent_id = "PERFECT_BVH_PT_sampling"
    bl_options: ClassVar = set()

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        settings = context.scene.perfect_bvh
        _draw_samples(layout, settings, "viewport_")
        _draw_denoising(layout, settings, "use_viewport_denoising")


class PERFECT_BVH_PT_sampling_render(EnginePanel, bpy.types.Panel):
    """Of renders, and of views that are rendered to an image."""

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
    """What few want to change."""

    bl_label = "Advanced"
    bl_parent_id = "PERFECT_BVH_PT_sampling"

    def draw(self, context: bpy.types.Context) -> None:
        settings_layout(self).prop(context.scene.perfect_bvh, "seed")


def _draw_samples(layout: bpy.types.UILayout, settings: bpy.types.bpy_struct, kind: str) -> None:
    """The threshold with its switch, and what it leaves to say. kind: what the properties' names begin with."""
    is_noisy, is_adaptive = _is_noisy(settings), getattr(settings, f"use_{kind}noise_threshold")
    row = layout.column(heading="Noise Threshold", align=True).row(align=True)
    row.active = is_noisy
    row.prop(settings, f"use_{kind}noise_threshold", text="")
    value = row.row()
    value.active = is_adaptive
    value.prop(settings, f"{kind}noise_threshold", text="")
    column = layout.column(align=True)
    _draw_max(column, settings, kind, "Max Samples" if is_noisy and is_adaptive else "Samples")
    if is_adaptive:
        least = column.row()
        least.active = is_noisy
        least.prop(settings, f"{kind}min_samples", text="Min Samples")


def _draw_max(layout: bpy.types.UILayout, settings: bpy.types.bpy_struct, kind: str, name: str) -> None:
    """Of viewports: as many as a render takes, or a number of their own."""
    if not kind:
        layout.prop(settings, "samples", text=name)
        return
    layout.column(heading=name, align=True).prop(settings, "use_render_samples", text="As Render")
    if not settings.use_render_samples:
        layout.prop(settings, "viewport_samples", text=" ")


def _draw_denoising(layout: bpy.types.UILayout, settings: bpy.types.bpy_struct, name: str) -> None:
    """A switch that says by what."""
    column = layout.column(heading="Denoise")
    column.active = _is_noisy(settings)
    column.prop(settings, name, text=denoiser_in_use())


def _is_noisy(settings: bpy.types.bpy_struct) -> bool:
    return find_mode(settings.mode.lower()).is_noisy


CLASSES = (
    PERFECT_BVH_PT_sampling,
    PERFECT_BVH_PT_sampling_viewport,
    PERFECT_BVH_PT_sampling_render,
    PERFECT_BVH_PT_sampling_advanced,
)
