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

import bpy
import numpy as np
import numpy.typing as npt

Step = Generator[float, None, None]

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


def wait_until(condition: Callable[[], object], what: str, seconds: float = 30.0) -> Step:
    """Let Blender work until `condition` holds; fail after `seconds`."""
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            raise StepError(f"waited {seconds:g} s in vain: {what}")
        yield 0.05


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


def press_key(key: str) -> Step:
    x_tool("key", key)
    yield 0.3


def press_here() -> Step:
    """The left button, where the mouse is."""
    x_tool("mousedown", 1)
    yield 0.1
    x_tool("mouseup", 1)
    yield 0.3


def click(x: float, y: float) -> Step:
    hover(x, y)
    yield 0.15
    x_tool("mousemove_relative", "--", 1, 0)
    yield 0.15
    yield from press_here()


def type_text(text: str) -> Step:
    x_tool("type", "--delay", 20, text)
    yield 0.2


def drag(button: int, start: tuple[float, float], end: tuple[float, float], steps: int = 8) -> Step:
    """Press a mouse button at one point, move, release it at another."""
    hover(*start)
    yield 0.3
    x_tool("mousedown", button)
    yield 0.3
    for step in range(1, steps + 1):
        hover(*(a + (b - a) * step / steps for a, b in zip(start, end, strict=True)))
        yield 0.1
    x_tool("mouseup", button)
    yield 0.5


# Windows -------------------------------------------------------------------------------------------------------------

_front = 0


def front_window() -> bpy.types.Window:
    """The one that the mouse is in and areas are looked for in."""
    return bpy.context.window_manager.windows[_front]


def work_in_window(number: int) -> None:
    """From now on the mouse is in this window, counted as they were opened."""
    global _front
    _front = number


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
        set_window_size(window.width, window.height + height - region_of(main_area()).height)
        yield 0.7
        region = region_of(main_area())
        # Areas share what a window gains or loses, and round it: not every height can be had.
        if abs(region.width - width) <= 2 and abs(region.height - height) <= 8:
            return
    raise StepError(f"the viewport has {region.width} x {region.height} pixels, not {width} x {height}")


# Eyes ----------------------------------------------------------------------------------------------------------------


def screenshot(name: str) -> None:
    """The whole screen as a PNG file."""
    subprocess.run(["import", "-window", "root", str(OUTPUT / f"{name}.png")], check=True, timeout=20)


def screen_pixels() -> npt.NDArray[np.uint8]:
    """The whole screen, flat."""
    made = subprocess.run(["import", "-window", "root", "-depth", "8", "rgb:-"], check=True, capture_output=True)
    return np.frombuffer(made.stdout, np.uint8)


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
