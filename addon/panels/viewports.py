"""The panels of 3D viewports: overlays, shading, the view menu and the walk of a ray."""

from __future__ import annotations

from typing import Any, ClassVar

import bpy

from ..settings.modes import find_mode
from ..settings.preferences import native_error
from ..settings.scene_settings import ENGINE_NAME
from ..settings.shading_settings import mode_of, overlay_settings
from .common import (
    TABS,
    SidebarPanel,
    StudyPanel,
    draw_lines,
    draw_main_button,
    draw_manual,
    draw_messages_of,
    draw_props,
    draw_purpose,
    settings_layout,
)

# The choice of trees' boxes over 3D viewports; their description is in the viewports themselves.


class PERFECT_BVH_PT_overlay(bpy.types.Panel):
    """The trees' boxes, level by level, with any render engine."""

    bl_label = "BVH Boxes"
    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"
    bl_parent_id = "VIEW3D_PT_overlay"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return native_error() is None

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        settings = overlay_settings(context.space_data)
        layout.active = context.space_data.overlay.show_overlays
        draw_props(layout.row(), settings, "show_top_level", "show_active")
        column = layout.column()
        column.active = settings.show_top_level or settings.show_active
        column.prop(settings, "level")
        draw_props(column.row(), settings, "use_all_to_level", "use_in_front")
        split = column.split(factor=0.25)
        split.label(text="Color")
        split.row(align=True).prop(settings, "color_by", expand=True)


class PERFECT_BVH_PT_display(StudyPanel, bpy.types.Panel):
    """The same settings in the sidebar, where Compare shows boxes of the same level in the same colors."""

    bl_label = "Display"
    page = "blender#the-sidebars-tab-bvh-study-see-what-a-scene-costs"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        text = (
            "A BVH is a tree of boxes in which rays look for triangles. This shows the boxes over the viewport, level "
            "by level. SAH: expected cost of a ray, lower is better"
        )
        draw_purpose(context, layout, text)
        settings = overlay_settings(context.space_data)
        if not context.space_data.overlay.show_overlays:
            draw_lines(context, layout, "Overlays are off in this viewport", icon="INFO", inset=TABS)
        column = layout.column(heading="Boxes", align=True)
        draw_props(column, settings, "show_top_level", "show_active")
        draw_props(layout, settings, "level", "use_all_to_level", "use_in_front", "color_by")


# Shading -------------------------------------------------------------------------------------------------------------
# The Viewport Shading popover in Rendered shading: the content and the light of a viewport.


class ShadingPanel:
    """A panel in the shading popover of a viewport that this engine renders."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"
    bl_parent_id = "VIEW3D_PT_shading"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        is_shown = context.engine == ENGINE_NAME and context.space_data.shading.type == "RENDERED"
        return is_shown and native_error() is None


class PERFECT_BVH_PT_shading_lighting(ShadingPanel, bpy.types.Panel):
    """The scene's own light, or Blender's studio."""

    bl_label = "Lighting"

    def draw(self, context: bpy.types.Context) -> None:
        layout, shading = self.layout, context.space_data.shading
        layout.active = find_mode(mode_of(context.scene, shading)).shading
        draw_props(layout, shading, "use_scene_lights_render", "use_scene_world_render")
        if not shading.use_scene_world_render:
            _draw_studio(layout, shading)


class PERFECT_BVH_PT_shading_render_pass(ShadingPanel, bpy.types.Panel):
    """What this viewport shows."""

    bl_label = "Mode"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.space_data.shading.perfect_bvh, "mode", text="")


def _draw_studio(layout: bpy.types.UILayout, shading: Any) -> None:
    """Draws the settings as Blender's own engines do, except blurring, which Cycles lacks as well."""
    split = layout.split(factor=0.9)
    row = split.column().row()
    row.scale_y = 0.6
    row.template_icon_view(shading, "studio_light", scale_popup=3.0)
    split.operator("screen.userpref_show", emboss=False, text="", icon="PREFERENCES").section = "LIGHTS"
    column = layout.split(factor=0.9).column()
    column.prop(shading, "studiolight_rotate_z", text="Rotation")
    draw_props(column, shading, "studiolight_intensity", "studiolight_background_alpha")


# Render view ---------------------------------------------------------------------------------------------------------
# The button that renders a viewport's view.


class PERFECT_BVH_PT_render_view(SidebarPanel, bpy.types.Panel):
    """The button, and the size of the image."""

    bl_label = "Render View to Image"
    page = "blender#viewports"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        draw_purpose(context, self.layout, "Renders this viewport into the Image Editor")
        draw_main_button(context, self.layout, "perfect_bvh.preview", "Render View", "RENDER_STILL")
        draw_messages_of(context, self.layout, "Render View to Image")


# Menus ---------------------------------------------------------------------------------------------------------------
# Of 3D viewports: View, where Blender renders viewports to images as well, and Object. And the Help menu.


def _draw(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    if native_error() is None:
        menu.layout.separator()
        menu.layout.operator("perfect_bvh.preview", icon="RENDER_STILL")


def _draw_object(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    if native_error() is None:
        menu.layout.separator()
        menu.layout.operator("perfect_bvh.bake_rays")


def _draw_help(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    menu.layout.separator()
    draw_manual(menu.layout, "blender", "Perfect BVH Manual")


def register() -> None:
    bpy.types.VIEW3D_MT_view.append(_draw)
    bpy.types.VIEW3D_MT_object.append(_draw_object)
    bpy.types.TOPBAR_MT_help.append(_draw_help)


def unregister() -> None:
    bpy.types.TOPBAR_MT_help.remove(_draw_help)
    bpy.types.VIEW3D_MT_object.remove(_draw_object)
    bpy.types.VIEW3D_MT_view.remove(_draw)


# Walk ray ------------------------------------------------------------------------------------------------------------
# The button that walks a ray, and those that step through the walk.


BUTTONS = (
    ("FIRST", "REW"),
    ("PREVIOUS", "PREV_KEYFRAME"),
    ("PREVIOUS_BOX", "FRAME_PREV"),
    ("PLAY", "PLAY"),
    ("NEXT_BOX", "FRAME_NEXT"),
    ("NEXT", "NEXT_KEYFRAME"),
    ("LAST", "FF"),
)


WALK_WORDS = (
    "Pruned: not visited, as it begins behind a hit. Times are estimates by calibration. SAH cost: visits and tests, "
    "as the surface area heuristic (SAH) counts them for an average ray"
)


class PERFECT_BVH_PT_walk_ray(StudyPanel, bpy.types.Panel):
    """The controls of the walk. The viewport shows the current step."""

    bl_label = "Walk a Ray"
    page = "blender#the-sidebars-tab-bvh-study-see-what-a-scene-costs"

    def draw(self, context: bpy.types.Context) -> None:
        from ..view3d.walk import walk_view
        from ..view3d.walk.walk_picture import place_of

        layout = self.layout
        draw_purpose(context, layout, "Click a pixel to follow its ray through the BVH, box by box")
        walk = walk_view.shown()
        row = draw_main_button(context, layout, "perfect_bvh.walk_ray", "Walk a Ray", "CURVE_PATH")
        if walk is None:
            draw_messages_of(context, layout, "Walk a Ray")
            return
        row.operator("perfect_bvh.walk_step", text="", icon="X").to = "OFF"
        if walk.is_old(context.scene):
            draw_messages_of(context, layout, "Walk a Ray")
            return
        row = layout.row(align=True)
        row.alignment = "CENTER"
        for to, icon in BUTTONS:
            shown = "PAUSE" if to == "PLAY" and walk.is_playing else icon
            row.operator("perfect_bvh.walk_step", text="", icon=shown).to = to
        row = layout.row()
        row.alignment = "CENTER"
        row.label(text=place_of(walk.index, len(walk.steps)))
        draw_purpose(context, layout, WALK_WORDS)
        draw_messages_of(context, layout, "Walk a Ray")
