"""How far light bounces. Cycles keeps these settings in the file, and both engines follow them."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ..settings.light_paths import light_path_settings
from ..settings.modes import mode_of_render
from .common import EnginePanel, draw_lines, settings_layout

CYCLES_IS_OFF = "Enable the add-on Cycles Render Engine: it keeps these settings. Without it they have their defaults"


class LightPathsPanel(EnginePanel):
    """One of those below Light Paths: not where there is nothing to set."""

    bl_parent_id = "PERFECT_BVH_PT_light_paths"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and light_path_settings(context.scene) is not None


class PERFECT_BVH_PT_light_paths(EnginePanel, bpy.types.Panel):
    """Holds the others, and says where there is nothing to set."""

    bl_label = "Light Paths"

    def draw(self, context: bpy.types.Context) -> None:
        if light_path_settings(context.scene) is None:
            draw_lines(context, self.layout, CYCLES_IS_OFF, icon="INFO")


class PERFECT_BVH_PT_light_paths_bounces(LightPathsPanel, bpy.types.Panel):
    """How often light turns at surfaces of each kind."""

    bl_label = "Max Bounces"
    bl_options: ClassVar = set()

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = _layout_of(self, context), light_path_settings(context.scene)
        layout.prop(settings, "max_bounces", text="Total")
        column = layout.column(align=True)
        column.prop(settings, "diffuse_bounces", text="Diffuse")
        column.prop(settings, "glossy_bounces", text="Glossy")
        column.prop(settings, "transmission_bounces", text="Transmission")
        layout.prop(settings, "transparent_max_bounces", text="Transparent")


class PERFECT_BVH_PT_light_paths_clamping(LightPathsPanel, bpy.types.Panel):
    """How bright a single sample may be."""

    bl_label = "Clamping"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = _layout_of(self, context), light_path_settings(context.scene)
        column = layout.column(align=True)
        column.prop(settings, "sample_clamp_direct", text="Direct")
        column.prop(settings, "sample_clamp_indirect", text="Indirect")


class PERFECT_BVH_PT_light_paths_caustics(LightPathsPanel, bpy.types.Panel):
    """Light that mirrors and glass throw on matt surfaces."""

    bl_label = "Caustics"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = _layout_of(self, context), light_path_settings(context.scene)
        layout.prop(settings, "blur_glossy")
        column = layout.column(heading="Caustics", align=True)
        column.prop(settings, "caustics_reflective", text="Reflective")
        column.prop(settings, "caustics_refractive", text="Refractive")


def _layout_of(panel: bpy.types.Panel, context: bpy.types.Context) -> bpy.types.UILayout:
    """Greyed out in modes without light that bounces."""
    layout = settings_layout(panel)
    layout.active = mode_of_render(context.scene).shading
    return layout


CLASSES = (
    PERFECT_BVH_PT_light_paths,
    PERFECT_BVH_PT_light_paths_bounces,
    PERFECT_BVH_PT_light_paths_clamping,
    PERFECT_BVH_PT_light_paths_caustics,
)
