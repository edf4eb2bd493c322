"""The world's light."""

from __future__ import annotations

from typing import ClassVar

import bpy

from .common import RenderPanel
from .nodes import draw_surface


class WorldPanel(RenderPanel):
    """In the properties of the world."""

    bl_context = "world"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and context.world is not None


class PERFECT_BVH_PT_world_preview(WorldPanel, bpy.types.Panel):
    """Blender has panels of its own for those of materials and lights alone."""

    bl_label = "Preview"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.template_preview(context.world)


class PERFECT_BVH_PT_world_surface(WorldPanel, bpy.types.Panel):
    """What shines from all around."""

    bl_label = "Surface"

    def draw(self, context: bpy.types.Context) -> None:
        draw_surface(self.layout, context.world, "color")


CLASSES = (PERFECT_BVH_PT_world_preview, PERFECT_BVH_PT_world_surface)
