"""Motion blur: Blender's own settings, and those that Cycles keeps in the file, which both engines follow."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ..settings.modes import mode_of_render
from ..settings.motion_blur import object_motion_settings, rolling_shutter_settings
from .common import EnginePanel, settings_layout

MOVING_TYPES = frozenset({"MESH", "CURVE", "CURVES", "SURFACE", "FONT", "META", "POINTCLOUD", "CAMERA", "EMPTY"})
DEFORMED_TYPES = MOVING_TYPES - {"CAMERA", "EMPTY"}


def _layout_of(panel: bpy.types.Panel, context: bpy.types.Context) -> bpy.types.UILayout:
    """Greyed out where nothing is blurred."""
    layout = settings_layout(panel)
    scene = context.scene
    layout.active = scene.render.use_motion_blur and mode_of_render(scene).has_bounces
    return layout


class PERFECT_BVH_PT_motion_blur(EnginePanel, bpy.types.Panel):
    """When the shutter is open."""

    bl_label = "Motion Blur"

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context: bpy.types.Context) -> None:
        layout, render = _layout_of(self, context), context.scene.render
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
    """How far it is open when."""

    bl_label = "Shutter Curve"
    bl_parent_id = "PERFECT_BVH_PT_motion_blur"

    def draw(self, context: bpy.types.Context) -> None:
        layout, render = _layout_of(self, context), context.scene.render
        layout.use_property_split = False
        layout.template_curve_mapping(render, "motion_blur_shutter_curve")


class PERFECT_BVH_PT_object_motion_blur(EnginePanel, bpy.types.Panel):
    """What of an object's motion is shown, and how closely."""

    bl_label = "Motion Blur"
    bl_context = "object"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not super().poll(context) or context.object is None:
            return False
        owner = context.object
        return owner.type in MOVING_TYPES and object_motion_settings(owner) is not None

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.active = context.scene.render.use_motion_blur
        self.layout.prop(object_motion_settings(context.object), "use_motion_blur", text="")

    def draw(self, context: bpy.types.Context) -> None:
        layout, owner = _layout_of(self, context), context.object
        settings = object_motion_settings(owner)
        layout.active = layout.active and settings.use_motion_blur
        column = layout.column()
        column.prop(settings, "motion_steps", text="Steps")
        if owner.type in DEFORMED_TYPES:
            column.prop(settings, "use_deform_motion", text="Deformation")


RENDER_CLASSES = (PERFECT_BVH_PT_motion_blur, PERFECT_BVH_PT_motion_blur_curve)
OBJECT_CLASSES = (PERFECT_BVH_PT_object_motion_blur,)
