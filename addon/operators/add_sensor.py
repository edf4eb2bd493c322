"""The button *Add Sensor*: an object that carries the scan's sensor, at the 3D cursor."""

from __future__ import annotations

from typing import ClassVar

import bpy

from .ticking import Checked

NAME, SIZE = "Sensor", 0.25


class PERFECT_BVH_OT_add_sensor(Checked, bpy.types.Operator):
    """An Empty that looks along its +Y axis."""

    bl_idname = "perfect_bvh.add_sensor"
    bl_label = "Add Sensor"
    bl_description = (
        "Add an Empty at the 3D cursor that carries the scan's sensor. It looks along its +Y axis, with +Z up. "
        "While it is selected, the viewport shows the sensor's lines and range"
    )
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def _find_complaint(cls, context: bpy.types.Context) -> str | None:
        return None if context.mode == "OBJECT" else "Sensors can be added in Object Mode only"

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, layer, cursor = context.scene, context.view_layer, context.scene.cursor
        obj = bpy.data.objects.new(NAME, None)
        obj.empty_display_type, obj.empty_display_size = "ARROWS", SIZE
        obj.matrix_world = cursor.matrix
        context.collection.objects.link(obj)
        layer.update()  # or its objects may still be those of before
        for other in layer.objects:
            if other.select_get():
                other.select_set(False)
        if obj.name in layer.objects:  # not where the collection is excluded
            obj.select_set(True)
            layer.objects.active = obj
        scene.perfect_bvh.scan.sensor = obj
        return {"FINISHED"}


CLASSES = (PERFECT_BVH_OT_add_sensor,)
