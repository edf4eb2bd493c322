"""What the image shows, its background, threads, and Blender's own Simplify settings."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ..settings.modes import find_mode, mode_of_render
from ..settings.preferences import native_error
from ..view3d.rendered import opening
from .common import EnginePanel, RenderPanel, draw_lines, settings_layout


class PERFECT_BVH_PT_render(RenderPanel, bpy.types.Panel):
    """What the image shows: the first thing below the choice of the engine, like Cycles' device."""

    bl_label = "Perfect BVH"
    bl_options: ClassVar = {"HIDE_HEADER"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        error = native_error()
        if error is not None:
            box = layout.box()
            box.alert = True
            box.label(text="The engine cannot run", icon="ERROR")
            draw_lines(context, box, error)
            return
        settings = context.scene.perfect_bvh
        layout.prop(settings, "mode")
        if find_mode(settings.mode.lower()).offers_grey:
            layout.prop(settings, "use_material_colors")
        if settings.mode == "CLAY":
            layout.prop(settings, "ao_distance")
        _draw_view_hint(context, layout)
        column = layout.column(align=True)
        column.operator("perfect_bvh.preview", icon="RENDER_STILL")
        column.prop(settings, "preview_percentage", text="Size")


class PERFECT_BVH_PT_film(EnginePanel, bpy.types.Panel):
    """The background's alpha."""

    bl_label = "Film"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        layout.prop(context.scene.render, "film_transparent", text="Transparent")


class PERFECT_BVH_PT_performance(EnginePanel, bpy.types.Panel):
    """Threads, and whether Blender keeps its evaluated scene from frame to frame."""

    bl_label = "Performance"

    def draw(self, context: bpy.types.Context) -> None:
        layout = settings_layout(self)
        render = context.scene.render
        layout.prop(render, "threads_mode")
        column = layout.column()
        column.enabled = render.threads_mode == "FIXED"
        column.prop(render, "threads")
        layout.column(heading="Persistent").prop(render, "use_persistent_data", text="Data")


class PERFECT_BVH_PT_performance_viewport(EnginePanel, bpy.types.Panel):
    """What opening the file begins with."""

    bl_label = "Viewport"
    bl_parent_id = "PERFECT_BVH_PT_performance"
    bl_options: ClassVar = set()

    def draw(self, context: bpy.types.Context) -> None:
        settings_layout(self).column(heading="Open").prop(context.screen, opening.PROPERTY, text="Rendered")


class PERFECT_BVH_PT_simplify(RenderPanel, bpy.types.Panel):
    """Blender's own Simplify settings. Its panel would stand above this engine's, which come first everywhere else."""

    bl_label = "Simplify"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    draw_header = bpy.types.RENDER_PT_simplify.draw_header
    draw = bpy.types.RENDER_PT_simplify.draw


class PERFECT_BVH_PT_simplify_viewport(RenderPanel, bpy.types.Panel):
    """Simplify in viewports."""

    bl_label = "Viewport"
    bl_parent_id = "PERFECT_BVH_PT_simplify"

    draw = bpy.types.RENDER_PT_simplify_viewport.draw


class PERFECT_BVH_PT_simplify_render(RenderPanel, bpy.types.Panel):
    """Simplify in renders."""

    bl_label = "Render"
    bl_parent_id = "PERFECT_BVH_PT_simplify"

    draw = bpy.types.RENDER_PT_simplify_render.draw


def _draw_view_hint(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """Files of data modes bypass the scene's view transform; what the Image Editor shows does not."""
    scene = context.scene
    view_transform = mode_of_render(scene).view
    if view_transform is not None and scene.view_settings.view_transform != view_transform:
        column = layout.column(align=True)
        draw_lines(context, column, f"Files use {view_transform}; the display uses:", icon="INFO")
        column.prop(scene.view_settings, "view_transform", text="View Transform")


CLASSES = (PERFECT_BVH_PT_render,)
# After the panels of Sampling and of Light Paths.
LAST_CLASSES = (
    PERFECT_BVH_PT_film,
    PERFECT_BVH_PT_simplify,
    PERFECT_BVH_PT_simplify_viewport,
    PERFECT_BVH_PT_simplify_render,
    PERFECT_BVH_PT_performance,
    PERFECT_BVH_PT_performance_viewport,
)
