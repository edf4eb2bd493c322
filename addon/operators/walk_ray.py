"""Walk a Ray: click a pixel of a 3D viewport, and step through what the ray does that is cast through it.

It runs beside Blender: the view can be turned, panels can be used, and another click walks another ray. It ends with
Esc, with an undo, with another file or scene, and where its viewport is closed. Nothing of the scene is changed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar

import bpy

from ..settings.preferences import native_error
from ..statistics import messages
from .ticking import sentence_of

if TYPE_CHECKING:
    from ..view3d.walk_reading import Reading

TIMER_SECONDS = 0.05
PICKING = "Walk a Ray: click a pixel of a 3D viewport; Esc cancels"
WALKING = "Walk a Ray: Left and Right step, Space plays, Home and End, click another pixel; Esc ends"
KEYS = {
    "LEFT_ARROW": "PREVIOUS",
    "RIGHT_ARROW": "NEXT",
    "HOME": "FIRST",
    "END": "LAST",
    "SPACE": "PLAY",
}


class PERFECT_BVH_OT_walk_ray(bpy.types.Operator):
    """Waits for clicks and keys, and for trees that are being built."""

    bl_idname = "perfect_bvh.walk_ray"
    bl_label = "Walk a Ray"
    bl_description = "Click a pixel, and step through what its ray does: which boxes and triangles it meets, and why"
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

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        complaint = native_error()
        if complaint is None and not _has_viewport(context):
            complaint = "There is no 3D viewport"
        if complaint is not None:
            cls.poll_message_set(complaint)
        return complaint is None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        from ..view3d import compare_view, decay_view, walk_view

        for view in (walk_view, compare_view, decay_view):  # what lies over the pixels
            view.hide()
        PERFECT_BVH_OT_walk_ray._newest += 1
        self._number = PERFECT_BVH_OT_walk_ray._newest
        self._reading = self._walk = None
        messages.tell(context.scene, self.bl_label)
        self._waited, self._owns_click = 0.0, False
        self._window = context.window
        self._timer = context.window_manager.event_timer_add(TIMER_SECONDS, window=context.window)
        self._window.cursor_modal_set("CROSSHAIR")
        context.workspace.status_text_set(PICKING)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        self.report({"ERROR"}, "Walk a Ray needs a click into a 3D viewport: a script has to invoke it")
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
        if region is None or self._walk is None or event.value != "PRESS" or event.type not in KEYS:
            return {"PASS_THROUGH"}
        step(KEYS[event.type])
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends or opens another file."""
        self._end(context)

    # The parts -------------------------------------------------------------------------------------------------------

    def _is_over(self, context: bpy.types.Context) -> bool:
        """Whether another was started, or what was shown has gone, or the viewport where it was or is to be."""
        from ..view3d import walk_view

        if self._number != PERFECT_BVH_OT_walk_ray._newest:
            return True
        walk, reading = self._walk, self._reading
        used = ([] if walk is None else [walk.space]) + ([] if reading is None else [reading.address])
        spaces = (area.spaces.active for area in context.window.screen.areas)
        if not {space.as_pointer() for space in spaces if space is not None}.issuperset(used):
            return True
        return walk is not None and (walk_view.shown() is not walk or context.scene.session_uid != walk.scene_uid)

    def _take_click(
        self, context: bpy.types.Context, event: bpy.types.Event, place: tuple[Any, Any] | None
    ) -> set[str]:
        if event.value != "PRESS":  # whoever takes the press takes the release
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
        from ..view3d.walk_reading import read_pixel

        self._reading = read_pixel(context, area, region, x, y)
        self._look(context)

    def _look(self, context: bpy.types.Context) -> None:
        """Show the walk if its trees are there."""
        from ..view3d import walk_view

        reading: Reading = self._reading
        walk = reading.walk(context)
        if walk is None:
            context.workspace.status_text_set(f"{reading.state}: Esc stops it")
            return
        self._reading, self._walk = None, walk
        walk_view.show(walk)
        self._window.cursor_modal_restore()
        context.workspace.status_text_set(WALKING)

    def _tick(self, context: bpy.types.Context) -> None:
        from ..view3d import walk_view

        if self._reading is not None:
            self._attempt(context, lambda: self._look(context))
        if self._walk is None or not self._walk.is_playing:
            self._waited = 0.0
            return
        self._waited += TIMER_SECONDS
        if self._waited >= walk_view.PLAY_SECONDS:
            self._waited = 0.0
            self._walk.go(self._walk.index + 1)
            walk_view.redraw()

    def _attempt(self, context: bpy.types.Context, work: Callable[[], None]) -> None:
        """What cannot be done is reported and left in the panels, and another pixel can be clicked."""
        import perfect_bvh

        try:
            work()
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            self._reading = None
            text = sentence_of(problem)
            self.report({"WARNING"}, text)
            messages.tell(context.scene, self.bl_label, text)

    def _end(self, context: bpy.types.Context) -> set[str]:
        from ..view3d import walk_view

        context.window_manager.event_timer_remove(self._timer)
        if self._reading is not None:
            self._reading.stop()
        if self._number != PERFECT_BVH_OT_walk_ray._newest:
            return {"CANCELLED"}  # the cursor and the status bar are the newer one's
        self._window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        walk_view.hide()
        return {"CANCELLED"} if self._walk is None else {"FINISHED"}


class PERFECT_BVH_OT_walk_step(bpy.types.Operator):
    """The buttons that keys stand for."""

    bl_idname = "perfect_bvh.walk_step"
    bl_label = "Step"
    bl_description = "Go to another step of the ray that is walked"
    bl_options: ClassVar = {"INTERNAL"}

    to: bpy.props.EnumProperty(
        name="To",
        description="Which step of the ray is shown next, or whether the steps play",
        items=[
            ("FIRST", "First", "Go to the first step of the ray"),
            ("PREVIOUS", "Previous", "Go back to the step before"),
            ("PLAY", "Play", "Play the steps one after the other, or pause"),
            ("NEXT", "Next", "Go on to the next step"),
            ("LAST", "Last", "Go to the last step, with the hit"),
            ("OFF", "End", "Show the scene again without the ray"),
        ],
        options={"SKIP_SAVE"},
    )

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        return cls.bl_rna.properties["to"].enum_items[properties.to].description

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if native_error() is not None or not is_walking():
            cls.poll_message_set("No ray is walked")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        step(self.to)
        return {"FINISHED"}


def step(to: str) -> None:
    """Of the walk that is shown, to another step: see `PERFECT_BVH_OT_walk_step`."""
    from ..view3d import walk_view

    walk = walk_view.shown()
    if walk is None:
        return
    if to == "OFF":
        walk_view.hide()
    elif to == "PLAY":
        walk.play_or_pause()
    else:
        walk.is_playing = False
        walk.go({"FIRST": 0, "PREVIOUS": walk.index - 1, "NEXT": walk.index + 1, "LAST": len(walk.steps) - 1}[to])
    walk_view.redraw()


def is_walking() -> bool:
    """Whether a ray's walk is shown."""
    from ..view3d import walk_view

    return walk_view.shown() is not None


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


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_OT_walk_ray)
    bpy.utils.register_class(PERFECT_BVH_OT_walk_step)


def unregister() -> None:
    bpy.utils.unregister_class(PERFECT_BVH_OT_walk_step)
    bpy.utils.unregister_class(PERFECT_BVH_OT_walk_ray)
