"""What trees cost from frame to frame, as curves over a 3D viewport: where a click goes, the scene goes.

Drawn by a handler; a gizmo in the same place takes the mouse, so that all else of the viewport works as ever. Curves
stay as they were measured; where the scene has been edited since, that is said.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy

from ...events.changes import edit_count, listen, stop_listening, watch_again
from ...settings.editors import redraw_viewports
from ..close_button import close_rect, contains
from ..draw_handler import DrawHandler
from ..legend import is_main
from .decay_chart import draw_chart, layout_of, panel_of

if TYPE_CHECKING:
    from .decay import Decay


@dataclass(slots=True)
class Shown:
    """What is drawn, and in which viewport, by its address. edits: of the scene, when the first frame was read."""

    decay: Decay
    space: int
    edits: int


class _Watcher:
    """Ends what is shown with the file."""

    def on_change(self, what: str) -> None:
        """Curves stay as they were measured."""

    def on_file_change(self) -> None:
        hide()


_shown: Shown | None = None
_watcher = _Watcher()


def show(decay: Decay, space: int, edits: int) -> None:
    """In a viewport, by its address, until `hide`; also what is added to it later.

    edits: the `edit_count` of the scene before its first frame was read.
    """
    global _shown
    listen(_watcher)
    _shown = Shown(decay, space, edits)
    redraw_viewports()


def hide() -> None:
    """Draw it no more; does nothing where nothing is drawn."""
    global _shown
    if _shown is None:
        return
    _shown = None
    stop_listening(_watcher)
    redraw_viewports()


def shown() -> Shown | None:
    """What is drawn, in whichever viewport; None if nothing is."""
    return _shown


def shown_in(context: bpy.types.Context) -> Decay | None:
    """What the context's viewport shows; None if it shows none, or none of its scene."""
    found = _shown
    if found is None or context.space_data is None or context.space_data.as_pointer() != found.space:
        return None
    return found.decay if context.scene.session_uid == found.decay.scene_uid else None


def is_old(found: Shown, scene: bpy.types.Scene) -> bool:
    """Whether the scene was edited since, as far as is known. Which frame it shows makes no difference."""
    return edit_count(scene.session_uid) != found.edits


def go_to(context: bpy.types.Context, x: float) -> None:
    """Show the frame that stands at a place of the region, in pixels."""
    decay = shown_in(context)
    if decay is None or not decay.rows:
        return
    layout = layout_of(decay, panel_of(context.area, context.region))
    frame = layout.frame_at(x, [row.frame for row in decay.rows])
    if frame != context.scene.frame_current:
        context.scene.frame_set(frame)
        redraw_viewports()


# Drawing -------------------------------------------------------------------------------------------------------------


def _draw() -> None:
    context = bpy.context
    decay = shown_in(context)
    if _shown is None or decay is None or not is_main(context.area, context.region):
        return
    watch_again()
    draw_chart(context, decay, is_old=is_old(_shown, context.scene))


# The mouse -----------------------------------------------------------------------------------------------------------


class PERFECT_BVH_GT_decay(bpy.types.Gizmo):
    """The chart, as far as the mouse is concerned: its cross closes it, elsewhere a frame is chosen."""

    bl_idname = "PERFECT_BVH_GT_decay"

    def setup(self) -> None:
        self.is_closing = False

    def draw(self, context: bpy.types.Context) -> None:
        """The handler does."""

    def test_select(self, context: bpy.types.Context, location: Sequence[int]) -> int:
        """Whether the mouse is over it."""
        if shown_in(context) is None or not is_main(context.area, context.region):
            return -1
        return 0 if contains(panel_of(context.area, context.region), *location) else -1

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        panel = panel_of(context.area, context.region)
        cross = close_rect(panel.right, panel.top)
        self.is_closing = contains(cross, event.mouse_region_x, event.mouse_region_y)
        if not self.is_closing:
            go_to(context, event.mouse_region_x)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event, tweak: set[str]) -> set[str]:
        if event.type == "MOUSEMOVE" and not self.is_closing:
            go_to(context, event.mouse_region_x)
        return {"RUNNING_MODAL"}

    def exit(self, context: bpy.types.Context, cancel: bool) -> None:
        if self.is_closing and not cancel:
            hide()


class PERFECT_BVH_GGT_decay(bpy.types.GizmoGroup):
    """Holds the chart."""

    bl_idname = "PERFECT_BVH_GGT_decay"
    bl_label = "Decay"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"PERSISTENT"}  # noqa: RUF012 - as Blender wants it

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return shown_in(context) is not None

    def setup(self, context: bpy.types.Context) -> None:
        self.gizmos.new(PERFECT_BVH_GT_decay.bl_idname)


CLASSES = (PERFECT_BVH_GT_decay, PERFECT_BVH_GGT_decay)
_handler = DrawHandler(_draw, "POST_PIXEL")


def register() -> None:
    """Draw where something is shown."""
    for owner in CLASSES:
        bpy.utils.register_class(owner)
    _handler.add()


def unregister() -> None:
    """Draw no more, and forget what was measured."""
    hide()
    _handler.remove()
    for owner in reversed(CLASSES):
        bpy.utils.unregister_class(owner)
