"""Steps of a ray's walk: the actions of keys, as buttons."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar

import bpy

from ..settings.preferences import redraw_viewports
from ..statistics import messages
from . import ticking
from .ticking import Checked, sentence_of

if TYPE_CHECKING:
    from ..view3d.walk.walk_picture import ShownWalk
    from ..view3d.walk.walk_view import Reading


class PERFECT_BVH_OT_walk_step(Checked, bpy.types.Operator):
    """The actions of keys, as buttons."""

    bl_idname = "perfect_bvh.walk_step"
    bl_label = "Step"
    bl_description = "Go to another step of the ray"
    bl_options: ClassVar = {"INTERNAL"}

    to: bpy.props.EnumProperty(
        name="To",
        description="The step of the ray to show next, or whether to play the steps",
        items=[
            ("FIRST", "First", "Go to the first step of the ray"),
            ("PREVIOUS", "Previous", "Go back to the previous step"),
            ("PREVIOUS_BOX", "Previous Box", "Go back to the previous box or triangle"),
            ("PLAY", "Play", "Play the steps one after the other, or pause"),
            ("NEXT_BOX", "Next Box", "Go on to the next box or triangle, and see what happens to it"),
            ("NEXT", "Next", "Go on to the next step: a node with its boxes, or a leaf with its triangles"),
            ("LAST", "Last", "Go to the last step, with the hit"),
            ("OFF", "End", "Stop showing the ray"),
        ],
        options={"SKIP_SAVE"},
    )

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        return cls.bl_rna.properties["to"].enum_items[properties.to].description

    @classmethod
    def _find_complaint(cls, context: bpy.types.Context) -> str | None:
        from ..view3d.walk import walk_view

        return "No ray is shown" if walk_view.shown() is None else None

    def execute(self, context: bpy.types.Context) -> set[str]:
        go(self.to)
        return {"FINISHED"}


def go(to: str) -> None:
    """Goes to another step of the shown walk: see `PERFECT_BVH_OT_walk_step`."""
    from ..view3d.walk import walk_view

    walk = walk_view.shown()
    if walk is None:
        return
    if to == "OFF":
        walk_view.hide()
        return
    if to == "PLAY":
        walk.play_or_pause()
    else:
        walk.is_playing = False
        _move(walk, to)
    redraw_viewports()


def _move(walk: ShownWalk, to: str) -> None:
    if to == "NEXT":
        walk.go_to_next_step()
    elif to == "NEXT_BOX":
        walk.go_to_next_box()
    elif to == "PREVIOUS_BOX":
        walk.go_to_previous_box()
    else:
        walk.go({"FIRST": 0, "PREVIOUS": walk.index - 1, "LAST": len(walk.steps) - 1}[to])


# Walk ray ------------------------------------------------------------------------------------------------------------
# Walk a Ray: click a pixel of a 3D viewport, and step through the walk of the ray that is cast through it.
#
# It runs while Blender is used: the view can be turned, panels can be used, and another click walks another ray. When
# the scene changes, the walk is hidden, and another click is awaited. It ends with Esc, with an undo,
# with another file or scene, and when its viewport is closed. It changes nothing in the scene.


TIMER_SECONDS = 0.05
PICKING = "Walk a Ray: click a pixel of a 3D viewport; Esc cancels"
WALKING = "Left/Right: step, Shift+Left/Right: box, Space: play, Click: other pixel, Esc: end"
KEYS = {
    "LEFT_ARROW": "PREVIOUS",
    "RIGHT_ARROW": "NEXT",
    "HOME": "FIRST",
    "END": "LAST",
    "SPACE": "PLAY",
}
SHIFT_KEYS = {"LEFT_ARROW": "PREVIOUS_BOX", "RIGHT_ARROW": "NEXT_BOX"}


class PERFECT_BVH_OT_walk_ray(Checked, bpy.types.Operator):
    """Waits for clicks and keys, and for trees that are being built."""

    bl_idname = "perfect_bvh.walk_ray"
    bl_label = "Walk a Ray"
    bl_description = "Click a pixel and step through its ray: the boxes and triangles it tests and hits, and why"
    bl_options: ClassVar = {"REGISTER"}

    _newest: ClassVar[int] = 0  # of all that were started: it alone goes on

    _number: int
    # Blender evaluates these annotations, and what they are of needs the native engine.
    _timer: Any
    _window: Any
    _reading: Any
    _walk: Any
    _waited: float
    _owns_click: bool
    _knows_it_is_old: bool

    @classmethod
    def _find_complaint(cls, context: bpy.types.Context) -> str | None:
        return None if _has_viewport(context) else "There is no 3D viewport"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        from ..view3d.compare import compare_view
        from ..view3d.walk import walk_view

        for view in (walk_view, compare_view):  # what lies over the pixels
            view.hide()
        PERFECT_BVH_OT_walk_ray._newest += 1
        self._number = PERFECT_BVH_OT_walk_ray._newest
        self._reading = self._walk = None
        messages.tell(context.scene, self.bl_label)
        self._waited, self._owns_click, self._knows_it_is_old = 0.0, False, False
        self._window = context.window
        self._timer = context.window_manager.event_timer_add(TIMER_SECONDS, window=context.window)
        self._window.cursor_modal_set("CROSSHAIR")
        ticking.tell(context, PICKING)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        self.report({"ERROR"}, "Walk a Ray needs a click in a 3D viewport: scripts must call it with 'INVOKE_DEFAULT'")
        return {"CANCELLED"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self._is_over(context):
            return self._end(context)
        if event.type == "TIMER":
            self._tick(context)
            return {"PASS_THROUGH"}
        if event.type == "ESC" and event.value == "PRESS":
            return self._end(context)
        region = find_region(context.window, event.mouse_x, event.mouse_y)
        if event.type == "LEFTMOUSE":
            return self._take_click(context, event, region)
        if region is None or self._walk is None or self._walk.is_old(context.scene) or event.value != "PRESS":
            return {"PASS_THROUGH"}
        to = (SHIFT_KEYS if event.shift else KEYS).get(event.type)
        if to is None:
            return {"PASS_THROUGH"}
        go(to)
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends or opens another file."""
        self._end(context)

    # The parts -------------------------------------------------------------------------------------------------------

    def _is_over(self, context: bpy.types.Context) -> bool:
        """Whether another was started, or the walk has ended, or its viewport is closed."""
        from ..view3d.walk import walk_view

        if self._number != PERFECT_BVH_OT_walk_ray._newest:
            return True
        walk, reading = self._walk, self._reading
        used = ([] if walk is None else [walk.space]) + ([] if reading is None else [reading.address])
        spaces = (area.spaces.active for area in context.window.screen.areas)
        if not {space.as_pointer() for space in spaces if space is not None}.issuperset(used):
            return True
        if any(one is not None and one.read.scene_uid != context.scene.session_uid for one in (walk, reading)):
            return True
        return walk is not None and walk_view.shown() is not walk

    def _take_click(
        self, context: bpy.types.Context, event: bpy.types.Event, place: tuple[Any, Any] | None
    ) -> set[str]:
        if event.value != "PRESS":  # the handler of the press also gets the release
            owned, self._owns_click = self._owns_click, False
            return {"RUNNING_MODAL"} if owned else {"PASS_THROUGH"}
        if place is None:
            return {"PASS_THROUGH"}
        self._owns_click = True
        area, region = place
        messages.tell(context.scene, self.bl_label)
        self._attempt(context, lambda: self._begin(context, area, region, event.mouse_x, event.mouse_y))
        return {"RUNNING_MODAL"}

    def _begin(self, context: bpy.types.Context, area: Any, region: Any, x: int, y: int) -> None:
        from ..view3d.walk.walk_view import read_pixel

        self._reading = read_pixel(context, area, region, x, y)
        self._look(context)

    def _look(self, context: bpy.types.Context) -> None:
        """Show the walk if its trees are there."""
        from ..view3d.walk import walk_view

        reading: Reading = self._reading
        walk = reading.walk(context)
        if walk is None:
            ticking.tell(context, f"{reading.state} | Esc: Cancel")
            return
        self._reading, self._walk, self._knows_it_is_old = None, walk, False
        walk_view.show(walk)
        self._window.cursor_modal_restore()
        ticking.tell(context, WALKING)

    def _tick(self, context: bpy.types.Context) -> None:
        from ..view3d.walk import walk_view
        from ..view3d.walk.walk_picture import CHANGED

        if self._reading is not None:
            self._attempt(context, lambda: self._look(context))
        walk = self._walk
        if walk is not None and walk.is_old(context.scene) and not self._knows_it_is_old:
            self._ask_again(context, CHANGED)
        if walk is None or not walk.is_playing:
            self._waited = 0.0
            return
        self._waited += TIMER_SECONDS
        if self._waited >= walk_view.PLAY_SECONDS:
            self._waited = 0.0
            walk.go_on()
            redraw_viewports()

    def _attempt(self, context: bpy.types.Context, work: Callable[[], None]) -> None:
        """Does the work; errors are reported and kept in the panels, and another pixel can be clicked."""
        import perfect_bvh

        try:
            work()
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            if self._reading is not None:
                self._reading.stop()
            self._reading = None
            self._ask_again(context, sentence_of(problem))

    def _ask_again(self, context: bpy.types.Context, why: str) -> None:
        """Waits for a click again; a valid walk stays."""
        self.report({"WARNING"}, why)
        messages.tell(context.scene, self.bl_label, why)
        self._knows_it_is_old = self._walk is not None and self._walk.is_old(context.scene)
        if self._walk is None or self._knows_it_is_old:
            self._window.cursor_modal_set("CROSSHAIR")
            ticking.tell(context, PICKING)
        else:
            ticking.tell(context, WALKING)
        redraw_viewports()

    def _end(self, context: bpy.types.Context) -> set[str]:
        from ..view3d.walk import walk_view

        context.window_manager.event_timer_remove(self._timer)
        if self._reading is not None:
            self._reading.stop()
        if self._number != PERFECT_BVH_OT_walk_ray._newest:
            return {"CANCELLED"}  # the cursor and the status bar are the newer one's
        self._window.cursor_modal_restore()
        ticking.clear(context)
        walk_view.hide()
        return {"CANCELLED"} if self._walk is None else {"FINISHED"}


def find_region(window: bpy.types.Window, x: int, y: int) -> tuple[Any, Any] | None:
    """The 3D viewport at a place of a window, and its main region there; None where another region lies over it."""
    for area in window.screen.areas:
        if area.type != "VIEW_3D" or not _holds(area, x, y):
            continue
        regions = [region for region in area.regions if region.width > 1 and region.height > 1 and _holds(region, x, y)]
        if regions and all(region.type == "WINDOW" for region in regions):
            return area, regions[0]
    return None


def _holds(rect: Any, x: int, y: int) -> bool:
    return rect.x <= x < rect.x + rect.width and rect.y <= y < rect.y + rect.height


def _has_viewport(context: bpy.types.Context) -> bool:
    if bpy.app.background or context.window is None:
        return False
    return any(area.type == "VIEW_3D" for area in context.window.screen.areas)


CLASSES = (PERFECT_BVH_OT_walk_step, PERFECT_BVH_OT_walk_ray)
