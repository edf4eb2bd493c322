"""Runs steps inside a Blender with windows, and looks at its screen.

Steps are generators that yield seconds to wait, during which Blender works on. No wait may rely on timing: steps wait
for a condition, and gates hold work that has to last (gates.py).
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from console_alarms import find_alarms

Step = Generator[float, None, Any]

OUTPUT = Path(os.environ["WINDOWS_OUTPUT"])
CONSOLE = OUTPUT / "console.log"


class StepError(AssertionError):
    """A step found something that is not as it should be."""


def check(condition: object, message: str) -> None:
    """Fail the step with `message` unless `condition` holds."""
    if not condition:
        raise StepError(message)


def wait_until(condition: Callable[[], object], what: str, seconds: float = 180.0, every: float = 0.05) -> Step:
    """Let Blender work until `condition` holds, checked at the interval `every`; fail after `seconds`."""
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            raise StepError(f"waited {seconds:g} s in vain: {what}")
        yield every


def redrawn() -> Step:
    """Wait until scripts' changes are evaluated and drawn, which Blender does between two calls of a timer."""
    for _ in range(2):
        yield 0.01


# Eyes ----------------------------------------------------------------------------------------------------------------


def screenshot(name: str) -> None:
    """The whole screen as a PNG file."""
    subprocess.run(["import", "-window", "root", str(OUTPUT / f"{name}.png")], check=True, timeout=120)


def screen_pixels() -> npt.NDArray[np.uint8]:
    """The whole screen, flat."""
    made = subprocess.run(["import", "-window", "root", "-depth", "8", "rgb:-"], check=True, capture_output=True)
    return np.frombuffer(made.stdout, np.uint8)


def area_pixels(area: bpy.types.Area) -> npt.NDArray[np.uint8]:
    """The screen's pixels of an area of the first window, flat."""
    window = bpy.context.window_manager.windows[0]
    shape = f"{area.width}x{area.height}+{area.x}+{window.height - area.y - area.height}"
    command = ["import", "-window", "root", "-crop", shape, "-depth", "8", "rgb:-"]
    return np.frombuffer(subprocess.run(command, check=True, capture_output=True).stdout, np.uint8)


def at_rest(area: bpy.types.Area, pause: float = 0.15) -> Step:
    """Wait until nothing in it moves for this number of seconds, as panels slide into place. Returns its pixels."""
    before = None
    for _ in range(100):
        yield pause
        yield from redrawn()  # in a pause that is over already Blender has done nothing
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
    return find_alarms(CONSOLE.read_text(encoding="utf-8", errors="replace"))


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
        except Exception:  # noqa: BLE001 - after any error the run must end and report it
            traceback.print_exc()
            screenshot("failure")
            print("A STEP FAILED", flush=True)
            sys.stdout.flush()
            os._exit(1)
        return None

    bpy.app.timers.register(advance, first_interval=2.0, persistent=True)
