"""A hand on the mouse and the keyboard of a Blender with windows, and eyes on its screen; runs inside that Blender.

Steps are generators that yield seconds to wait, during which Blender works on. Clicks and keys are real ones, through
the X server: what the user does is what is tried.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from typing import Any, ClassVar

import bpy
import numpy as np
import numpy.typing as npt

Step = Generator[float, None, Any]

OUTPUT = Path(os.environ["WINDOWS_OUTPUT"])
CONSOLE = OUTPUT / "console.log"
SCREEN_HEIGHT = int(subprocess.check_output(["xdotool", "getdisplaygeometry"], text=True).split()[1])
ALARMS = ("Traceback (most recent call last)", "Error: Python:", "Segmentation fault")


class StepError(AssertionError):
    """A step found something that is not as it should be."""


def check(condition: object, message: str) -> None:
    """Fail the step with `message` unless `condition` holds."""
    if not condition:
        raise StepError(message)


def wait_until(condition: Callable[[], object], what: str, seconds: float = 180.0, every: float = 0.05) -> Step:
    """Let Blender work until `condition` holds; fail after `seconds`, looking every so many of them."""
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            raise StepError(f"waited {seconds:g} s in vain: {what}")
        yield every


def redrawn() -> Step:
    """Until what scripts have changed was evaluated and drawn, which Blender does between two looks of a timer."""
    for _ in range(2):
        yield 0.01


# Hands ---------------------------------------------------------------------------------------------------------------


_hand = subprocess.Popen(["xdotool", "-"], stdin=subprocess.PIPE, text=True)


def x_tool(*arguments: object) -> None:
    """One xdotool command, by a process that goes on: the mouse moves thousands of times."""
    assert _hand.stdin is not None and _hand.poll() is None
    print(*arguments, file=_hand.stdin, flush=True)


def screen_point(x: float, y: float) -> tuple[int, int]:
    """The X server's coordinates, from the top, of Blender's in the window in front, from the bottom."""
    window = front_window()
    # The first one begins in the corner of the screen, whatever height it has been given.
    left, top = (0, 0) if _front == 0 else (window.x, SCREEN_HEIGHT - window.y - window.height)
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
    """Of each window the last (key, "PRESS" or "RELEASE")."""
    events = set()
    for window in bpy.context.window_manager.windows:
        with bpy.context.temp_override(window=window):
            bpy.ops.wm.note_last_event("INVOKE_DEFAULT")
        events.add(WM_OT_note_last_event.noted)
    return events


def handled() -> Step:
    """Until Blender has done all that the hands have asked for, and drawn what comes of it.

    Input is handled in its order: so an idle key is pressed that no window has heard last, until one has.
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


# Windows -------------------------------------------------------------------------------------------------------------

_front = 0


def front_window() -> bpy.types.Window:
    """The one that the mouse is in and areas are looked for in."""
    return bpy.context.window_manager.windows[_front]


def work_in_window(number: int) -> None:
    """From now on the mouse is in this window, counted as they were opened."""
    global _front
    _front = number


def window_stands() -> Step:
    """Until the window in front stays where it is, and as large: it opens somewhere, and is moved then."""
    place, since = None, 0.0
    for _ in range(600):
        window = front_window()
        now = window.x, window.y, window.width, window.height
        if now != place:
            place, since = now, time.monotonic()
        elif time.monotonic() > since + 0.5:
            return
        yield 0.1
    raise StepError("a window does not come to rest")


# Places --------------------------------------------------------------------------------------------------------------


def area_of(kind: str) -> bpy.types.Area:
    """The largest area of a type."""
    areas = [area for area in front_window().screen.areas if area.type == kind]
    check(areas, f"no area of type {kind}")
    return max(areas, key=lambda area: area.width * area.height)


def main_area() -> bpy.types.Area:
    """The largest, in which the 3D viewport is wont to be."""
    return max(bpy.context.window_manager.windows[0].screen.areas, key=lambda area: area.width * area.height)


def region_of(area: bpy.types.Area, kind: str = "WINDOW") -> bpy.types.Region:
    return next(region for region in area.regions if region.type == kind)


def middle_of(area: bpy.types.Area) -> tuple[float, float]:
    region = region_of(area)
    return region.x + region.width / 2, region.y + region.height / 2


def context_of(area: bpy.types.Area) -> dict[str, object]:
    """What `temp_override` wants to be in an area."""
    return {"window": front_window(), "area": area, "region": region_of(area)}


def set_window_size(width: int, height: int) -> None:
    """Of the only window that is open."""
    found = subprocess.run(
        ["xdotool", "search", "--onlyvisible", "--class", "blender"], check=True, capture_output=True, text=True
    )
    x_tool("windowsize", found.stdout.split()[-1], width, height)


def set_viewport_size(width: int, height: int) -> Step:
    """Move the edge beside the 3D viewport and resize the window until the viewport has this size, nearly."""
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
        # Areas share what a window gains or loses, and round it: not every height can be had.
        if abs(region.width - width) <= 2 and abs(region.height - height) <= 8:
            return
    raise StepError(f"the viewport has {region.width} x {region.height} pixels, not {width} x {height}")


# Eyes ----------------------------------------------------------------------------------------------------------------


def screenshot(name: str) -> None:
    """The whole screen as a PNG file."""
    subprocess.run(["import", "-window", "root", str(OUTPUT / f"{name}.png")], check=True, timeout=120)


def screen_pixels() -> npt.NDArray[np.uint8]:
    """The whole screen, flat."""
    made = subprocess.run(["import", "-window", "root", "-depth", "8", "rgb:-"], check=True, capture_output=True)
    return np.frombuffer(made.stdout, np.uint8)


def area_pixels(area: bpy.types.Area) -> npt.NDArray[np.uint8]:
    """What the screen shows of an area of the first window, flat."""
    window = bpy.context.window_manager.windows[0]
    shape = f"{area.width}x{area.height}+{area.x}+{window.height - area.y - area.height}"
    command = ["import", "-window", "root", "-crop", shape, "-depth", "8", "rgb:-"]
    return np.frombuffer(subprocess.run(command, check=True, capture_output=True).stdout, np.uint8)


def at_rest(area: bpy.types.Area) -> Step:
    """Until nothing in it moves: panels glide to their places. Returns its pixels."""
    before = None
    for _ in range(100):
        yield 0.15
        now = area_pixels(area)
        if before is not None and np.array_equal(now, before):
            return now
        before = now
    raise StepError(f"the {area.type} editor does not come to rest")


def redraw() -> None:
    """Draw everything and wait until it is on the screen."""
    bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)


def alarms_on_console() -> list[str]:
    sys.stdout.flush()
    sys.stderr.flush()
    text = CONSOLE.read_text(encoding="utf-8", errors="replace")
    return [line for line in text.splitlines() if any(alarm in line for alarm in ALARMS)]


# The run -------------------------------------------------------------------------------------------------------------


def _all_steps(steps: Iterable[Callable[[], Step]]) -> Step:
    for number, step in enumerate(steps, 1):
        name = step.__name__
        started = time.monotonic()
        yield from step()
        screenshot(f"{number:02}_{name}")
        alarms = alarms_on_console()
        check(not alarms, f"on the console: {alarms[:3]}")
        print(f"PASSED {number:2} {name} ({time.monotonic() - started:.1f} s)", flush=True)


def run(steps: Iterable[Callable[[], Step]], finish: Callable[[], object]) -> None:
    """Do the steps one after the other, in a timer; `finish` after the last one. A failed step ends Blender at once."""
    script = _all_steps(steps)

    def advance() -> float | None:
        try:
            return next(script)
        except StopIteration:
            print("ALL STEPS PASSED", flush=True)
            finish()
        except Exception:  # noqa: BLE001 - whatever it is, the run must end and say so
            traceback.print_exc()
            screenshot("failure")
            print("A STEP FAILED", flush=True)
            sys.stdout.flush()
            os._exit(1)
        return None

    bpy.app.timers.register(advance, first_interval=2.0, persistent=True)
