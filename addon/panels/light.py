"""What Blender's own panels of lights leave out: the spread of areas, shadows, nodes."""

from __future__ import annotations

import bpy

from .common import RenderPanel
from .nodes import draw_surface


class LightPanel(RenderPanel):
    """In the properties of a light."""

    bl_context = "data"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and context.light is not None


class PERFECT_BVH_PT_light_beam(LightPanel, bpy.types.Panel):
    """Of an area. That of a spot is Blender's own."""

    bl_label = "Beam Shape"
    bl_parent_id = "DATA_PT_EEVEE_light"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and context.light.type == "AREA"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        self.layout.prop(context.light, "spread")


class PERFECT_BVH_PT_light_settings(LightPanel, bpy.types.Panel):
    """Under the name that it has with Cycles."""

    bl_label = "Settings"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        self.layout.prop(context.light, "use_shadow", text="Shadow")


class PERFECT_BVH_PT_light_nodes(LightPanel, bpy.types.Panel):
    """The emission that tints and dims a light."""

    bl_label = "Nodes"

    def draw(self, context: bpy.types.Context) -> None:
        draw_surface(self.layout, context.light, "")


CLASSES = (PERFECT_BVH_PT_light_beam, PERFECT_BVH_PT_light_settings, PERFECT_BVH_PT_light_nodes)
