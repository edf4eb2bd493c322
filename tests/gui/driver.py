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

Step = Generator[float, None, None]

OUTPUT = Path(os.environ["WINDOWS_OUTPUT"])
CONSOLE = OUTPUT / "console.log"
ALARMS = ("Traceback (most recent call last)", "Error: Python:", "Segmentation fault")


# In pixels, at the resolution scale that a new user has.
BUTTON_HEIGHT, ROW_HEIGHT = 20, 26


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


def x_tool(*arguments: object) -> None:
    """One xdotool command."""
    subprocess.run(["xdotool", *map(str, arguments)], check=True, timeout=20)


def screen_point(x: float, y: float) -> tuple[int, int]:
    """The X server's coordinates, from the top, of Blender's, from the bottom."""
    window = bpy.context.window_manager.windows[0]
    return int(x), int(window.height - 1 - y)


def hover(x: float, y: float) -> None:
    x_tool("mousemove", *screen_point(x, y))


def press_key(key: str) -> Step:
    x_tool("key", key)
    yield 0.3


def click(x: float, y: float) -> Step:
    hover(x, y)
    yield 0.15
    x_tool("mousemove_relative", "--", 1, 0)
    yield 0.15
    x_tool("click", 1)
    yield 0.4


def drag(button: int, start: tuple[float, float], end: tuple[float, float], steps: int = 8) -> Step:
    """Press a mouse button at one point, move, release it at another."""
    hover(*start)
    yield 0.1
    x_tool("mousedown", button)
    for step in range(1, steps + 1):
        hover(*(a + (b - a) * step / steps for a, b in zip(start, end, strict=True)))
        yield 0.05
    x_tool("mouseup", button)
    yield 0.2


# Where the button of a property was last found: nearly always it is there again.
_last_rows: dict[str, int] = {}

# Places --------------------------------------------------------------------------------------------------------------


def area_of(kind: str) -> bpy.types.Area:
    """The largest area of a type."""
    areas = [area for area in bpy.context.window_manager.windows[0].screen.areas if area.type == kind]
    check(areas, f"no area of type {kind}")
    return max(areas, key=lambda area: area.width * area.height)


def region_of(area: bpy.types.Area, kind: str = "WINDOW") -> bpy.types.Region:
    return next(region for region in area.regions if region.type == kind)


def middle_of(area: bpy.types.Area) -> tuple[float, float]:
    region = region_of(area)
    return region.x + region.width / 2, region.y + region.height / 2


def context_of(area: bpy.types.Area) -> dict[str, object]:
    """What `temp_override` wants to be in an area."""
    return {"window": bpy.context.window_manager.windows[0], "area": area, "region": region_of(area)}


def _find_property(area: bpy.types.Area, path: str, column: float = 0.75) -> Step:
    """Move the mouse down a column of a region until it is over the button of a property whose data path ends so."""
    region = region_of(area)

    def is_found() -> bool:
        with bpy.context.temp_override(**context_of(area)):
            found = bpy.context.property
        return found is not None and found[1].endswith(path)

    hover(*middle_of(area_of("VIEW_3D")))  # the last button stays active until the mouse has left the region
    yield 0.4
    rows = list(range(region.y + region.height - 6, region.y + 4, -BUTTON_HEIGHT + 4))
    if path in _last_rows:
        rows.insert(0, _last_rows[path])
    for y in rows:
        hover(region.x + region.width * column, y)
        yield 0.05
        if is_found():
            yield 0.2
            if is_found():
                _last_rows[path] = y
                return
    raise StepError(f"no button of {path} in the panel")


def _press() -> Step:
    x_tool("mousedown", 1)
    yield 0.15
    x_tool("mouseup", 1)
    yield 0.5


def click_property(area: bpy.types.Area, path: str) -> Step:
    """Click the button of a property by the end of its data path."""
    yield from _find_property(area, path)
    yield from _press()


def click_above(area: bpy.types.Area, path: str, rows: int = 1) -> Step:
    """Click the button so many rows above a property's: of an operator's button nothing says where it is."""
    yield from _find_property(area, path)
    for _ in range(rows):
        x_tool("mousemove_relative", "--", 0, -ROW_HEIGHT)
        yield 0.1
    yield from _press()


# Eyes ----------------------------------------------------------------------------------------------------------------


def screenshot(name: str) -> None:
    """The whole screen as a PNG file."""
    subprocess.run(["import", "-window", "root", str(OUTPUT / f"{name}.png")], check=True, timeout=20)


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
