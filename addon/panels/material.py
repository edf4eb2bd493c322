"""What a material is made of, and its number in passes."""

from __future__ import annotations

from typing import ClassVar

import bpy

from .common import RenderPanel, settings_layout
from .nodes import draw_surface


class MaterialPanel(RenderPanel):
    """In the properties of a material of anything but Grease Pencil."""

    bl_context = "material"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        material = context.material
        return super().poll(context) and material is not None and not material.grease_pencil


class PERFECT_BVH_PT_material_surface(MaterialPanel, bpy.types.Panel):
    """The nodes."""

    bl_label = "Surface"

    def draw(self, context: bpy.types.Context) -> None:
        draw_surface(self.layout, context.material, "diffuse_color")


class PERFECT_BVH_PT_material_settings(MaterialPanel, bpy.types.Panel):
    """What is beside the nodes."""

    bl_label = "Settings"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings_layout(self).prop(context.material, "pass_index")


CLASSES = (PERFECT_BVH_PT_material_surface, PERFECT_BVH_PT_material_settings)
