"""The panels of cameras, lights, materials, worlds and objects: Cycles' own where it has them, as it lays them out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import bpy

from ..settings.preferences import native_error
from ..settings.scene_settings import ENGINE_NAME, object_motion_settings
from .common import EnginePanel, RenderPanel, draw_lines, draw_props, settings_layout
from .render import motion_blur_layout

# Blender's own panels that stay of use with this engine.


# Panels that Blender offers every engine, without those of unsupported features; Simplify is shown at another
# position.
UNSUPPORTED_PANELS = ("freestyle", "grease_pencil", "gpencil", "render_pt_simplify")
# Those of which a fuller one is borrowed, and their copies in the Shader Editor.
POORER_PANELS = ("DATA_PT_light", "NODE_DATA_PT_light")
# Panels of Blender's own engines whose settings this engine honours, or that a user wants to change all the same, so
# that materials, lights and the world can be worked on without going to another engine and back.
BORROWED_PANELS = (
    "DATA_PT_EEVEE_light",
    "DATA_PT_camera_dof",
    "DATA_PT_camera_dof_aperture",
    "EEVEE_MATERIAL_PT_context_material",
    "MATERIAL_PT_preview",
    "VIEWLAYER_PT_layer_passes",
    "VIEWLAYER_PT_override",
)


def shared_panels() -> Iterator[type[bpy.types.Panel]]:
    """The panels of Blender that are shown with this engine."""
    for panel in _all_panels(bpy.types.Panel):
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if not isinstance(engines, set):
            continue
        name = panel.__name__
        is_out = name in POORER_PANELS or any(word in name.lower() for word in UNSUPPORTED_PANELS)
        if name in BORROWED_PANELS or ("BLENDER_RENDER" in engines and not is_out):
            yield panel


def _all_panels(base: type) -> Iterator[type[bpy.types.Panel]]:
    for panel in base.__subclasses__():
        yield panel
        yield from _all_panels(panel)


# Camera --------------------------------------------------------------------------------------------------------------
# What Blender shows of cameras with Cycles only.


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
        draw_props(layout.column(align=True), settings, latitude_min="Latitude Min", latitude_max="Max")
        draw_props(layout.column(align=True), settings, longitude_min="Longitude Min", longitude_max="Max")


# Nodes ---------------------------------------------------------------------------------------------------------------
# The nodes that this engine follows, in a panel. Blender's own show those of EEVEE, which may be others.


# From Blender 5.0 on materials and worlds always have nodes.
ALWAYS_NODES = bpy.app.version >= (5, 0, 0)


def draw_surface(layout: bpy.types.UILayout, owner: bpy.types.ID, plain: str) -> None:
    """Draws the node that is linked to the Surface of a material, a light or a world, to unfold and edit.

    plain: the property that counts without nodes; empty for a light, whose own color counts in addition.
    """
    if not (ALWAYS_NODES and plain):
        layout.prop(owner, "use_nodes", icon="NODETREE")
        layout.separator()
    layout.use_property_split = True
    tree = owner.node_tree
    if tree is None or not (owner.use_nodes or (ALWAYS_NODES and plain)):
        if plain:
            layout.prop(owner, plain)
        return
    # What extraction looks at: both engines show the same scene.
    output = tree.get_output_node("CYCLES")
    if output is None:
        layout.label(text="No output node", icon="ERROR")
    else:
        layout.template_node_view(tree, output, output.inputs["Surface"])


# Light ---------------------------------------------------------------------------------------------------------------
# What Blender's own panels of lights leave out: the spread of areas, shadows, nodes.


class LightPanel(RenderPanel):
    """A panel in the properties of a light."""

    bl_context = "data"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and context.light is not None


class PERFECT_BVH_PT_light_beam(LightPanel, bpy.types.Panel):
    """The beam of an area light. Blender has a panel for that of a spot."""

    bl_label = "Beam Shape"
    bl_parent_id = "DATA_PT_EEVEE_light"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and context.light.type == "AREA"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        self.layout.prop(context.light, "spread")


class PERFECT_BVH_PT_light_settings(LightPanel, bpy.types.Panel):
    """The settings of a light, under the same name as with Cycles."""

    bl_label = "Settings"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        self.layout.prop(context.light, "use_shadow", text="Shadow")


class PERFECT_BVH_PT_light_nodes(LightPanel, bpy.types.Panel):
    """The emission that tints and dims a light."""

    bl_label = "Nodes"

    def draw(self, context: bpy.types.Context) -> None:
        draw_surface(self.layout, context.light, "")


# Material ------------------------------------------------------------------------------------------------------------
# The properties of a material, and its number in passes.


class MaterialPanel(RenderPanel):
    """A panel in the properties of a material, except of Grease Pencil."""

    bl_context = "material"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        material = context.material
        return super().poll(context) and material is not None and not material.grease_pencil


class PERFECT_BVH_PT_material_surface(MaterialPanel, bpy.types.Panel):
    """The nodes of a material's surface."""

    bl_label = "Surface"

    def draw(self, context: bpy.types.Context) -> None:
        draw_surface(self.layout, context.material, "diffuse_color")


class PERFECT_BVH_PT_material_settings(MaterialPanel, bpy.types.Panel):
    """The settings of a material in addition to its nodes."""

    bl_label = "Settings"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings_layout(self).prop(context.material, "pass_index")


# World ---------------------------------------------------------------------------------------------------------------
# The world's light.


class WorldPanel(RenderPanel):
    """A panel in the properties of the world."""

    bl_context = "world"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and context.world is not None


class PERFECT_BVH_PT_world_preview(WorldPanel, bpy.types.Panel):
    """The preview of the world. Blender itself has such panels only for materials and lights."""

    bl_label = "Preview"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.template_preview(context.world)


class PERFECT_BVH_PT_world_surface(WorldPanel, bpy.types.Panel):
    """The nodes of the world's light."""

    bl_label = "Surface"

    def draw(self, context: bpy.types.Context) -> None:
        draw_surface(self.layout, context.world, "color")


# Visibility ----------------------------------------------------------------------------------------------------------
# Which rays see an object, and whether it shows shadows in place of itself: Blender offers that with Cycles only.


SHOWN_TYPES = ("MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD")


def has_rays(obj: bpy.types.Object | None) -> bool:
    """Whether rays can meet an object, or its instances, whose settings are its own as well."""
    return obj is not None and (obj.type in SHOWN_TYPES or obj.is_instancer)


class PERFECT_BVH_PT_ray_visibility(RenderPanel, bpy.types.Panel):
    """The kinds of rays that can hit an object."""

    bl_label = "Ray Visibility"
    bl_context = "object"
    bl_parent_id = "OBJECT_PT_visibility"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and has_rays(context.object)

    def draw(self, context: bpy.types.Context) -> None:
        rays = ("Camera", "Diffuse", "Glossy", "Transmission", "Volume Scatter", "Shadow")
        texts = {f"visible_{ray.lower().replace(' ', '_')}": ray for ray in rays}
        draw_props(settings_layout(self).column(), context.object, **texts)


def _draw_mask(panel: bpy.types.Panel, context: bpy.types.Context) -> None:
    """Below Blender's own Holdout."""
    if context.engine == ENGINE_NAME and has_rays(context.object):
        panel.layout.use_property_split = True
        panel.layout.prop(context.object, "is_shadow_catcher")


def register() -> None:
    bpy.types.OBJECT_PT_visibility.append(_draw_mask)


def unregister() -> None:
    bpy.types.OBJECT_PT_visibility.remove(_draw_mask)


# Motion of objects ----------------------------------------------------------------------------------------------------

MOVING_TYPES = frozenset({"MESH", "CURVE", "CURVES", "SURFACE", "FONT", "META", "POINTCLOUD", "CAMERA", "EMPTY"})
DEFORMED_TYPES = MOVING_TYPES - {"CAMERA", "EMPTY"}


class PERFECT_BVH_PT_object_motion_blur(EnginePanel, bpy.types.Panel):
    """The parts of an object's motion that are shown, and the number of time samples."""

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
        layout, owner = motion_blur_layout(self, context), context.object
        settings = object_motion_settings(owner)
        layout.active = layout.active and settings.use_motion_blur
        column = layout.column()
        column.prop(settings, "motion_steps", text="Steps")
        if owner.type in DEFORMED_TYPES:
            column.prop(settings, "use_deform_motion", text="Deformation")
