"""The common parts of the add-on's panels."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

import blf
import bpy

from ..settings.preferences import native_error
from ..settings.scene_settings import ENGINE_NAME
from ..statistics.messages import Message, messages_of, notes_of
from ..support.files import command_in

# Labels do not wrap, and a panel is as wide as its region. In pixels at the usual resolution scale: the width for
# borders and an icon, and the shortest length of a line. The font is the interface's own.
MARGIN, SHORTEST_LINE = 58, 60
FONT = 0
TABS = 20  # of a sidebar's width
MANUAL = Path(__file__).parents[1] / "manual"  # which the extension brings


class RenderPanel:
    """A panel for this engine, in the Render properties by default."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = frozenset({ENGINE_NAME})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.engine in cls.COMPAT_ENGINES


class EnginePanel(RenderPanel):
    """A panel of the engine's settings; hidden if the engine cannot run, which the first panel says."""

    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and native_error() is None


class SidebarPanel:
    """A panel of outputs, in a tab of the sidebar of 3D viewports, with any render engine."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Perfect BVH"
    page: ClassVar[str]  # of the manual, with the heading

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return native_error() is None

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        draw_manual(self.layout, self.page)


class StudyPanel(SidebarPanel):
    """A panel that explains the trees and their rays, in a separate tab."""

    bl_category = "BVH Study"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}


def draw_manual(layout: bpy.types.UILayout, page: str, text: str = "") -> None:
    """Draws a button that opens a page of the manual in the browser; none where the manual is not installed.

    text: its name in a menu; a panel has a question mark.
    """
    name, _, heading = page.partition("#")
    path = MANUAL / f"{name}.html"
    if path.exists():
        opener = "wm.url_open" if text else "perfect_bvh.open_manual"
        button = layout.operator(opener, text=text, icon="HELP", emboss=bool(text))
        button.url = f"{path.as_uri()}#{heading}" if heading else path.as_uri()


def settings_layout(panel: bpy.types.Panel) -> bpy.types.UILayout:
    """A panel's layout with names on the left and values on the right, as Blender has settings."""
    layout = panel.layout
    layout.use_property_split = True
    layout.use_property_decorate = False
    return layout


def draw_props(layout: bpy.types.UILayout, owner: bpy.types.bpy_struct, *names: str, **texts: str) -> None:
    """Draws properties, one after the other: first those with their own names, then those with other texts."""
    for name in names:
        layout.prop(owner, name)
    for name, text in texts.items():
        layout.prop(owner, name, text=text)


def text_width(text: str) -> float:
    """Returns the width of one line, in pixels at the usual resolution scale."""
    blf.size(FONT, bpy.context.preferences.ui_styles[0].widget.points)
    return float(blf.dimensions(FONT, text)[0])


def wrapped(context: bpy.types.Context, text: str, inset: float = 0.0) -> list[str]:
    """Wraps `text` to the width of the panel that is being drawn; paths that are longer than a line go on in the next.

    inset: the unavailable part of the width.
    """
    width = max(SHORTEST_LINE, context.region.width / context.preferences.system.ui_scale - MARGIN - inset)
    lines: list[str] = []
    for word in text.split():
        while len(word) > 1 and text_width(word) > width:
            end = max((end for end in range(2, len(word)) if text_width(word[:end]) <= width), default=1)
            lines.append(word[:end])
            word = word[end:]
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and text_width(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def draw_message(context: bpy.types.Context, layout: bpy.types.UILayout, message: Message, inset: float = 0.0) -> None:
    """Something that went wrong, or not as it should."""
    draw_lines(context, layout, message.text, "CANCEL" if message.is_error else "ERROR", inset)
    draw_command(layout, message.text)


def draw_command(layout: bpy.types.UILayout, text: str) -> None:
    """Draws a button that copies the command that a message has; none for other messages."""
    command = command_in(text)
    if command is not None:
        layout.operator("perfect_bvh.copy_command", icon="COPYDOWN").command = command


def draw_main_button(
    context: bpy.types.Context, layout: bpy.types.UILayout, name: str, text: str, icon: str
) -> bpy.types.UILayout:
    """Draws the button of a sidebar panel's work; if it is grey, the reason is below it. Returns the button's row."""
    row = layout.row(align=True)
    row.operator(name, text=text, icon=icon)
    operator = bpy.types.Operator.bl_rna_get_subclass_py(f"PERFECT_BVH_OT_{name.partition('.')[2]}")
    reason = operator.why_not(context)
    if reason is not None:
        draw_lines(context, layout, reason, "INFO", TABS)
    return row


def draw_messages_of(context: bpy.types.Context, layout: bpy.types.UILayout, source: str) -> None:
    """Shows the last errors and results of a sidebar panel's work: no other panel shows them with other engines."""
    for message in messages_of(context.scene):
        if message.source == source:
            draw_message(context, layout, message, TABS)
    for note in notes_of(context.scene, source):
        draw_lines(context, layout, note, "INFO", TABS)


def draw_purpose(context: bpy.types.Context, layout: bpy.types.UILayout, sentence: str) -> None:
    """Shows the purpose of a sidebar panel, above its settings."""
    draw_lines(context, layout.column(), sentence, inset=TABS)


def draw_lines(
    context: bpy.types.Context, layout: bpy.types.UILayout, text: str, icon: str = "NONE", inset: float = 0.0
) -> None:
    """A text of several lines, the first with an icon and the others flush with it. inset: as `wrapped` takes it."""
    column = layout.column(align=True)
    for number, line in enumerate(wrapped(context, text, inset)):
        column.label(text=line, icon="BLANK1" if number and icon != "NONE" else icon)
