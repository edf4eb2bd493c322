"""The mouse rests on a button until its tooltip shows: what the button is, or why it is grey."""

from __future__ import annotations

import bpy
import numpy as np
import numpy.typing as npt
from buttons import Button
from driver import (
    SCREEN_HEIGHT,
    Step,
    area_of,
    front_window,
    hover,
    main_area,
    middle_of,
    region_of,
    screen_pixels,
    screen_point,
    screenshot,
    wait_until,
    x_tool,
)
from panel_steps import main_buttons, open_sub_panel

TOOLTIP_BYTES = 6000  # of the screen that a tooltip changes, at least
# In pixels: what lights up at once, up and down from the middle of the button, and the status bar with its hints.
LIT, STATUS_BAR = 16, 30


def around(button: Button) -> npt.NDArray[np.uint8]:
    """The rows of the screen above and below a button."""
    rows = screen_pixels().reshape(SCREEN_HEIGHT, -1)
    _, y = screen_point(0, button.y)
    return np.concatenate((rows[: y - LIT], rows[y + LIT : front_window().height - STATUS_BAR]))


def let_the_screen_rest() -> Step:
    """With the mouse where nothing lights up, until the last tooltip has gone."""
    hover(*middle_of(main_area()))
    yield 0.2
    x_tool("mousemove_relative", "--", 5, 5)
    earlier = None
    for _ in range(10):
        yield 0.4
        now = screen_pixels()
        if earlier is not None and np.array_equal(now, earlier):
            return
        earlier = now


def rest_on(button: Button, name: str) -> Step:
    """One in each step: Blender lets a second one wait for more than the mouse."""
    area = area_of("PROPERTIES")
    region = region_of(area)
    yield from let_the_screen_rest()
    before = around(button)
    hover(region.x + region.width * button.column, button.y)
    yield 2.5  # what was shown before has gone by now
    is_shown = lambda: (around(button) != before).sum() > TOOLTIP_BYTES  # noqa: E731
    yield from wait_until(is_shown, f"{button.what} has no tooltip", 10)
    screenshot(f"tooltip_{name}")
    yield from let_the_screen_rest()


def show_tooltips() -> Step:
    buttons = yield from main_buttons()
    yield from rest_on(buttons["perfect_bvh.preview"], "preview")


def show_why_scan_is_grey() -> Step:
    scene = bpy.context.scene
    camera, scene.camera = scene.camera, None
    yield 0.3

    def work(buttons: list[Button]) -> Step:
        (button,) = [button for button in buttons if "perfect_bvh.scan(" in button.what]
        yield from rest_on(button, "grey_scan")

    yield from open_sub_panel("Rays", work)
    scene.camera = camera
    yield 0.3
