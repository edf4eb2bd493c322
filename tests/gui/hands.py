"""Uses the mouse and the keyboard of a Blender with windows: real clicks and keys, through the X server.

The tests use only the input of a user; each call ends when Blender has handled it.
"""

from __future__ import annotations

import subprocess
import time
from typing import ClassVar

import bpy
from driver import Step, StepError, redrawn
from places import front_window, main_area, region_of

SCREEN_HEIGHT = int(subprocess.check_output(["xdotool", "getdisplaygeometry"], text=True).split()[1])

_hand = subprocess.Popen(["xdotool", "-"], stdin=subprocess.PIPE, text=True)


def x_tool(*arguments: object) -> None:
    """One xdotool command, by a process that goes on: the mouse moves thousands of times."""
    assert _hand.stdin is not None and _hand.poll() is None
    print(*arguments, file=_hand.stdin, flush=True)


def screen_point(x: float, y: float) -> tuple[int, int]:
    """The X server's coordinates, from the top, of Blender's in the window in front, from the bottom."""
    window = front_window()
    # The first one begins in the corner of the screen, at any height.
    is_first = window == bpy.context.window_manager.windows[0]
    left, top = (0, 0) if is_first else (window.x, SCREEN_HEIGHT - window.y - window.height)
    return int(left + x), int(top + window.height - 1 - y)


def hover(x: float, y: float) -> None:
    x_tool("mousemove", *screen_point(x, y))


def press_key(*keys: str) -> Step:
    """One after the other."""
    x_tool("key", *keys)
    yield from handled()


def press_here() -> Step:
    """The left button, where the mouse is."""
    x_tool("click", 1)
    yield from handled()


def click(x: float, y: float) -> Step:
    hover(x, y)
    yield from handled()
    x_tool("mousemove_relative", "--", 1, 0)
    yield from press_here()


def type_text(text: str) -> Step:
    x_tool("type", "--delay", 20, text)
    yield from handled()


def drag(button: int, start: tuple[float, float], end: tuple[float, float], steps: int = 8) -> Step:
    """Press a mouse button at one point, move, release it at another."""
    hover(*start)
    yield from handled()
    x_tool("mousedown", button)
    for step in range(1, steps + 1):
        yield 0.02  # Blender takes two moves that it finds together for one
        hover(*(a + (b - a) * step / steps for a, b in zip(start, end, strict=True)))
    x_tool("mouseup", button)
    yield from handled()


# Keys that do nothing by themselves, as xdotool and as Blender call them.
IDLE_KEYS = {"Shift_R": "RIGHT_SHIFT", "Control_R": "RIGHT_CTRL", "Shift_L": "LEFT_SHIFT", "Control_L": "LEFT_CTRL"}


class WM_OT_note_last_event(bpy.types.Operator):  # noqa: N801 - as Blender wants it
    """Notes the last key or mouse button that a window has heard of."""

    bl_idname = "wm.note_last_event"
    bl_label = "Note Last Event"
    bl_options: ClassVar = {"INTERNAL"}
    noted: ClassVar[tuple[str, str]] = ("", "")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        WM_OT_note_last_event.noted = event.type, event.value
        return {"CANCELLED"}


bpy.utils.register_class(WM_OT_note_last_event)


def last_events() -> set[tuple[str, str]]:
    """Return the last (key, "PRESS" or "RELEASE") of each window."""
    events = set()
    for window in bpy.context.window_manager.windows:
        with bpy.context.temp_override(window=window):
            bpy.ops.wm.note_last_event("INVOKE_DEFAULT")
        events.add(WM_OT_note_last_event.noted)
    return events


def handled() -> Step:
    """Wait until Blender has handled all input, and drawn the result.

    Input is handled in order: so this presses an idle key that is not the last in any window, until a window has
    received it.
    """
    before = {name for name, _ in last_events()}
    key, name = next(item for item in IDLE_KEYS.items() if item[1] not in before)
    for _ in range(12):
        x_tool("key", key)
        deadline = time.monotonic() + 5.0  # windows that open and close may lose a key
        while time.monotonic() < deadline:
            if (name, "RELEASE") in last_events():
                yield 0.005  # it has arrived, and is handled after this timer
                return
            yield 0.005
    raise StepError("Blender hears no key")


def set_window_size(width: int, height: int) -> None:
    """Set the size of the only open window."""
    found = subprocess.run(
        ["xdotool", "search", "--onlyvisible", "--class", "blender"], check=True, capture_output=True, text=True
    )
    x_tool("windowsize", found.stdout.split()[-1], width, height)


def set_viewport_size(width: int, height: int) -> Step:
    """Move the edge of the 3D viewport and resize the window until the viewport has approximately this size."""
    for _ in range(12):
        area = main_area()
        missing = width - region_of(area).width
        if missing:
            start = area.x + area.width + 1, area.y + area.height / 2
            yield from drag(1, start, (start[0] + missing, start[1]))
        window = bpy.context.window_manager.windows[0]
        wanted = window.height + height - region_of(main_area()).height
        set_window_size(window.width, wanted)
        deadline = time.monotonic() + 5.0  # a height that cannot be had is noticed below
        while window.height != wanted and time.monotonic() < deadline:
            yield 0.02
        yield from redrawn()
        region = region_of(main_area())
        # Areas share a window's change in size, and round it, so some heights are impossible.
        if abs(region.width - width) <= 2 and abs(region.height - height) <= 8:
            return
    raise StepError(f"the viewport has {region.width} x {region.height} pixels, not {width} x {height}")
