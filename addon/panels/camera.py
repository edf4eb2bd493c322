"""What Blender shows of cameras with Cycles only."""

from __future__ import annotations

import bpy

from ..settings.preferences import native_error
from .common import RenderPanel, draw_lines

ONLY_EQUIRECTANGULAR = "Only Equirectangular can be rendered; viewports show the others in perspective"


class PERFECT_BVH_PT_panorama(RenderPanel, bpy.types.Panel):
    """The part of the sphere that a panoramic camera sees. Blender shows these settings with Cycles only."""

    bl_label = "Panorama"
    bl_context = "data"
    bl_parent_id = "DATA_PT_lens"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        camera = context.camera
        is_panoramic = camera is not None and camera.type == "PANO"
        return super().poll(context) and is_panoramic and native_error() is None

    def draw(self, context: bpy.types.Context) -> None:
        from ..extract.camera import panorama_settings  # needs the native engine, registering must not

        layout = self.layout
        layout.use_property_split = True
        settings = panorama_settings(context.camera)
        if settings is None:
            draw_lines(context, layout, "Enable the add-on Cycles: it keeps these settings", icon="ERROR")
            return
        layout.prop(settings, "panorama_type", text="Type")
        if settings.panorama_type != "EQUIRECTANGULAR":
            draw_lines(context, layout, ONLY_EQUIRECTANGULAR, icon="ERROR")
            return
        column = layout.column(align=True)
        column.prop(settings, "latitude_min", text="Latitude Min")
        column.prop(settings, "latitude_max", text="Max")
        column = layout.column(align=True)
        column.prop(settings, "longitude_min", text="Longitude Min")
        column.prop(settings, "longitude_max", text="Max")


CLASSES = (PERFECT_BVH_PT_panorama,)
