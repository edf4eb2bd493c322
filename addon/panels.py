"""The panels in the Render and View Layer properties, and Blender's own panels that stay of use with the engine."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import ClassVar

import bpy

from .engine import last_statistics
from .modes import find_mode
from .preferences import native_error
from .properties import ENGINE_NAME
from .summary import count_meshes, plan_rows, statistics_rows

# Panels that Blender offers every engine, without those of features that this engine does not have.
UNSUPPORTED_PANELS = ("freestyle", "grease_pencil", "gpencil", "stereoscopy", "output_views")
# Panels of Blender's own engines whose settings this engine honours.
BORROWED_PANELS = ("EEVEE_MATERIAL_PT_context_material", "VIEWLAYER_PT_layer_passes")


class RenderPanel:
    """Where all panels of the Render properties live."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = frozenset({ENGINE_NAME})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.engine in cls.COMPAT_ENGINES


class PERFECT_BVH_PT_render(RenderPanel, bpy.types.Panel):
    """What the image shows and how many samples it takes."""

    bl_label = "Perfect BVH"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        error = native_error()
        if error is not None:
            box = layout.box()
            box.alert = True
            box.label(text="The engine cannot run", icon="ERROR")
            for line in _wrapped(error):
                box.label(text=line)
            return
        scene = context.scene
        settings = scene.perfect_bvh
        layout.operator("perfect_bvh.preview", icon="IMAGE_DATA")
        layout.prop(settings, "mode")
        layout.prop(settings, "samples")
        if settings.mode in {"CLAY", "WIREFRAME"}:
            layout.prop(settings, "use_material_colors")
            layout.prop(settings, "ao_distance")
        _draw_view_hint(layout, scene)


class PERFECT_BVH_PT_film(RenderPanel, bpy.types.Panel):
    """The background's alpha."""

    bl_label = "Film"
    bl_parent_id = "PERFECT_BVH_PT_render"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        self.layout.prop(context.scene.render, "film_transparent", text="Transparent")


class PERFECT_BVH_PT_performance(RenderPanel, bpy.types.Panel):
    """Threads, and whether Blender keeps its evaluated scene from frame to frame."""

    bl_label = "Performance"
    bl_parent_id = "PERFECT_BVH_PT_render"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        render = context.scene.render
        layout.prop(render, "threads_mode")
        column = layout.column()
        column.enabled = render.threads_mode == "FIXED"
        column.prop(render, "threads")
        layout.prop(render, "use_persistent_data", text="Persistent Data")


class PERFECT_BVH_PT_statistics(RenderPanel, bpy.types.Panel):
    """What the last render of this scene did, and how long each step took."""

    bl_label = "Last Render"
    bl_parent_id = "PERFECT_BVH_PT_render"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and last_statistics(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        statistics = last_statistics(context.scene)
        split = self.layout.split(factor=0.4)
        names, values = split.column(align=True), split.column(align=True)
        names.alignment = "RIGHT"
        for name, value in statistics_rows(statistics):
            names.label(text=name)
            values.label(text=value)


class PERFECT_BVH_PT_plan(RenderPanel, bpy.types.Panel):
    """What the last render did with each mesh's tree, and why."""

    bl_label = "Plan"
    bl_parent_id = "PERFECT_BVH_PT_render"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and last_statistics(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        report = last_statistics(context.scene).report
        rows = plan_rows(report)
        for row in rows:
            column = self.layout.box().column(align=True)
            column.label(text=f"{row.name}: {row.triangle_count:,} triangles", icon="MESH_DATA")
            done = f"{row.action}, {row.builder}, {row.milliseconds:.1f} ms" if row.builder else row.action
            column.label(text=f"{row.usage}: {row.usage_reason}")
            for line in _wrapped(f"{done}: {row.reason}"):
                column.label(text=line)
        more = count_meshes(report) - len(rows)
        if more > 0:
            self.layout.label(text=f"and {more:,} more meshes")


class PERFECT_BVH_PT_failure_cases(RenderPanel, bpy.types.Panel):
    """Scenes to learn from."""

    bl_label = "Failure Cases"
    bl_parent_id = "PERFECT_BVH_PT_render"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.label(text="Scenes on which usual methods fail:")
        self.layout.operator_menu_enum("perfect_bvh.add_failure_case", "case", icon="SCENE_DATA")


class PERFECT_BVH_PT_passes(bpy.types.Panel):
    """The passes that the engine writes beside Combined."""

    bl_label = "Data"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "view_layer"
    bl_parent_id = "VIEWLAYER_PT_layer_passes"
    COMPAT_ENGINES = frozenset({ENGINE_NAME})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        view_layer = context.view_layer
        column = layout.column(heading="Include", align=True)
        column.prop(view_layer, "use_pass_z")
        column.prop(view_layer, "use_pass_normal")
        column = layout.column(heading="Indexes", align=True)
        column.prop(view_layer, "use_pass_object_index")
        column.prop(view_layer, "use_pass_material_index")


def _wrapped(text: str, width: int = 48) -> list[str]:
    """Labels do not wrap: the lines of `text`."""
    return textwrap.wrap(text, width)


def _draw_view_hint(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """Files of data modes bypass the scene's view transform; what the Image Editor shows does not."""
    view_transform = find_mode(scene.perfect_bvh.mode.lower()).view
    if view_transform is not None and scene.view_settings.view_transform != view_transform:
        column = layout.column(align=True)
        column.label(text=f"Files use {view_transform}. To see it here as well:", icon="INFO")
        column.prop(scene.view_settings, "view_transform", text="View Transform")


def _shared_panels() -> Iterator[type[bpy.types.Panel]]:
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if not isinstance(engines, set):
            continue
        is_unsupported = any(word in panel.__name__.lower() for word in UNSUPPORTED_PANELS)
        if panel.__name__ in BORROWED_PANELS or ("BLENDER_RENDER" in engines and not is_unsupported):
            yield panel


CLASSES = (
    PERFECT_BVH_PT_render,
    PERFECT_BVH_PT_film,
    PERFECT_BVH_PT_performance,
    PERFECT_BVH_PT_statistics,
    PERFECT_BVH_PT_plan,
    PERFECT_BVH_PT_failure_cases,
    PERFECT_BVH_PT_passes,
)


def register() -> None:
    for panel in CLASSES:
        bpy.utils.register_class(panel)
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.add(ENGINE_NAME)


def unregister() -> None:
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.discard(ENGINE_NAME)
    for panel in reversed(CLASSES):
        bpy.utils.unregister_class(panel)
