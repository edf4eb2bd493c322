"""Blender's own panels that stay of use with this engine, and the passes that it writes."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from ..settings.denoisers import denoising_data_settings
from ..settings.preferences import native_error
from .common import RenderPanel, draw_lines, settings_layout

# Panels that Blender offers every engine, without those of features that this engine does not have; Simplify it shows
# in a place of its own.
UNSUPPORTED_PANELS = ("freestyle", "grease_pencil", "gpencil", "render_pt_simplify")
# Panels of Blender's own engines whose settings this engine honours, or that a user wants to change all the same, so
# that materials, lights and the world can be worked on without going to another engine and back.
BORROWED_PANELS = (
    "DATA_PT_EEVEE_light",
    "DATA_PT_camera_dof",
    "DATA_PT_camera_dof_aperture",
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_WORLD_PT_surface",
    "VIEWLAYER_PT_layer_passes",
    "VIEWLAYER_PT_override",
)
ONLY_EQUIRECTANGULAR = "Only Equirectangular can be rendered; viewports show the others in perspective"


class PERFECT_BVH_PT_passes(RenderPanel, bpy.types.Panel):
    """The passes that the engine writes beside Combined."""

    bl_label = "Data"
    bl_context = "view_layer"
    bl_parent_id = "VIEWLAYER_PT_layer_passes"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        view_layer = context.view_layer
        column = layout.column(heading="Include", align=True)
        column.prop(view_layer, "use_pass_z")
        column.prop(view_layer, "use_pass_normal")
        column = layout.column(heading="Indexes", align=True)
        column.prop(view_layer, "use_pass_object_index")
        column.prop(view_layer, "use_pass_material_index")
        denoising = denoising_data_settings(view_layer)
        if denoising is not None:
            layout.prop(denoising, "denoising_store_passes", text="Denoising Data")


class PERFECT_BVH_PT_mask(RenderPanel, bpy.types.Panel):
    """What an object shows in place of itself. Blender has these switches with Cycles only."""

    bl_label = "Mask"
    bl_context = "object"
    bl_parent_id = "OBJECT_PT_visibility"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.prop(context.object, "is_holdout")
        layout.prop(context.object, "is_shadow_catcher")


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
        layout.prop(settings, "panorama_type")
        if settings.panorama_type != "EQUIRECTANGULAR":
            draw_lines(context, layout, ONLY_EQUIRECTANGULAR, icon="ERROR")
            return
        column = layout.column(align=True)
        column.prop(settings, "latitude_min", text="Latitude Min")
        column.prop(settings, "latitude_max", text="Max")
        column = layout.column(align=True)
        column.prop(settings, "longitude_min", text="Longitude Min")
        column.prop(settings, "longitude_max", text="Max")


def shared_panels() -> Iterator[type[bpy.types.Panel]]:
    """The panels of Blender that are shown with this engine."""
    for panel in _all_panels(bpy.types.Panel):
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if not isinstance(engines, set):
            continue
        is_unsupported = any(word in panel.__name__.lower() for word in UNSUPPORTED_PANELS)
        if panel.__name__ in BORROWED_PANELS or ("BLENDER_RENDER" in engines and not is_unsupported):
            yield panel


def _all_panels(base: type) -> Iterator[type[bpy.types.Panel]]:
    for panel in base.__subclasses__():
        yield panel
        yield from _all_panels(panel)


CLASSES = (PERFECT_BVH_PT_passes, PERFECT_BVH_PT_mask, PERFECT_BVH_PT_panorama)
