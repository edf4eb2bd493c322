"""What hair is: Cycles' settings, which this engine follows, or those of EEVEE where Cycles is off."""

from __future__ import annotations

from typing import ClassVar

import bpy

from .common import EnginePanel, settings_layout


class PERFECT_BVH_PT_hair(EnginePanel, bpy.types.Panel):
    """As Cycles names and lays it out."""

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


CLASSES = (PERFECT_BVH_PT_hair,)
