"""The mouse rests on a button until its tooltip shows: what the button is, or why it is grey."""

from __future__ import annotations

import bpy
from buttons import Button, leave
from driver import Step, area_of, hover, region_of, screen_pixels, screenshot, wait_until
from panel_steps import main_buttons, open_sub_panel

TOOLTIP_BYTES = 6000  # of the screen that a tooltip changes, at least; a button that lights up changes fewer


def rest_on(button: Button, name: str) -> Step:
    area = area_of("PROPERTIES")
    region = region_of(area)
    yield from leave(area)
    yield 0.3
    before = screen_pixels()
    hover(region.x + region.width * button.column, button.y)
    is_shown = lambda: (screen_pixels() != before).sum() > TOOLTIP_BYTES  # noqa: E731
    yield from wait_until(is_shown, f"{button.what} has no tooltip", 8)
    yield 0.2
    screenshot(f"tooltip_{name}")
    yield from leave(area)


def show_tooltips() -> Step:
    buttons = yield from main_buttons()
    for name in ("preview", "preview_percentage", "mode"):
        yield from rest_on(buttons[f"perfect_bvh.{name}"], name)


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
