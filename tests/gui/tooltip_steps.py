"""The mouse rests on a button until its tooltip explains the button, or why it is grey."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import numpy.typing as npt
from buttons import Button
from driver import Step, StepError, redrawn, screen_pixels, screenshot
from hands import SCREEN_HEIGHT, handled, hover, screen_point, x_tool
from panels import main_buttons, open_sidebar
from places import area_of, front_window, main_area, middle_of, panel_region

TOOLTIP_BYTES = 6000  # of the screen that a tooltip changes, at least
# In pixels: the area that lights up at once, up and down from the middle of the button, and the status bar with its
# hints.
LIT, STATUS_BAR = 16, 30


def around(button: Button) -> npt.NDArray[np.uint8]:
    """The rows of the screen above and below a button."""
    rows = screen_pixels().reshape(SCREEN_HEIGHT, -1)
    _, y = screen_point(0, button.y)
    return np.concatenate((rows[: y - LIT], rows[y + LIT : front_window().height - STATUS_BAR]))


def let_the_screen_rest() -> Step:
    """Move the mouse where nothing lights up, and wait until the last tooltip has gone."""
    hover(*middle_of(main_area()))
    yield from handled()
    x_tool("mousemove_relative", "--", 5, 5)
    yield from handled()
    yield from same_twice(screen_pixels)


def same_twice(look: Callable[[], npt.NDArray[np.uint8]]) -> Step:
    """Repeat `look`, with time for Blender in between, until two results are equal. Returns the result."""
    earlier = None
    for _ in range(100):
        yield 0.4
        now = look()
        if earlier is not None and np.array_equal(now, earlier):
            return now
        earlier = now
    raise StepError("the screen does not come to rest")


def rest_on(button: Button, name: str, kind: str = "PROPERTIES") -> Step:
    """One in each step: Blender lets a second one wait for more than the mouse. kind: of the button's area."""
    region = panel_region(area_of(kind))
    yield from let_the_screen_rest()
    before = around(button)
    hover(region.x + region.width * button.column, button.y)
    yield from handled()
    x_tool("mousemove_relative", "--", 1, 0)  # where a sidebar scrolls, the move that enters it shows none
    for _ in range(20):  # and a shown tooltip stays
        now = yield from same_twice(lambda: around(button))
        if (now != before).sum() > TOOLTIP_BYTES:
            break
    else:
        raise StepError(f"{button.what} has no tooltip")
    screenshot(f"tooltip_{name}")
    yield from let_the_screen_rest()


def show_tooltips() -> Step:
    buttons = yield from main_buttons()
    yield from rest_on(buttons["perfect_bvh.preview"], "preview")


def show_why_scan_is_grey() -> Step:
    scene = bpy.context.scene
    camera, scene.camera = scene.camera, None
    yield from redrawn()

    def work(buttons: list[Button]) -> Step:
        (button,) = [button for button in buttons if "perfect_bvh.scan(" in button.what]
        yield from rest_on(button, "grey_scan", "VIEW_3D")

    yield from open_sidebar("Scan", work)
    scene.camera = camera
    yield from redrawn()
