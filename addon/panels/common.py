"""What the add-on's panels share."""

from __future__ import annotations

import textwrap
from typing import ClassVar

import bpy

from ..settings.preferences import native_error
from ..settings.scene_settings import ENGINE_NAME

# Labels do not wrap, and a panel is as wide as its region. Pixels at the usual resolution scale, and no line shorter.
MARGIN, CHARACTER_WIDTH = 60, 5.7
SHORTEST_LINE = 20


class RenderPanel:
    """A panel that is shown with this engine, in the Render properties unless it says otherwise."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = frozenset({ENGINE_NAME})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.engine in cls.COMPAT_ENGINES


class EnginePanel(RenderPanel):
    """A panel of the engine's settings: not where the first one says that the engine cannot run."""

    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and native_error() is None


class SidebarPanel:
    """A panel of the add-on's own tab in the sidebar of 3D viewports, whatever the render engine is."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Perfect BVH"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return native_error() is None


def settings_layout(panel: bpy.types.Panel) -> bpy.types.UILayout:
    """A panel's layout with names on the left and values on the right, as Blender has settings."""
    layout = panel.layout
    layout.use_property_split = True
    layout.use_property_decorate = False
    return layout


def wrapped(context: bpy.types.Context, text: str, inset: float = 0.0) -> list[str]:
    """The lines of `text` as the panel that is being drawn has room for. inset: what is lost of that."""
    width = context.region.width / context.preferences.system.ui_scale - MARGIN - inset
    return textwrap.wrap(text, max(SHORTEST_LINE, int(width / CHARACTER_WIDTH)))


def draw_lines(
    context: bpy.types.Context, layout: bpy.types.UILayout, text: str, icon: str = "NONE", inset: float = 0.0
) -> None:
    """A text of several lines, the first with an icon and the others flush with it. inset: as `wrapped` takes it."""
    column = layout.column(align=True)
    for number, line in enumerate(wrapped(context, text, inset)):
        column.label(text=line, icon="BLANK1" if number and icon != "NONE" else icon)
