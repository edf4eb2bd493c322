"""Motion blur: its panel, and a render for which Blender goes to other frames and comes back."""

from __future__ import annotations

import bpy
from bad_use_steps import close_image, render_and_wait
from buttons import Button, change
from driver import Step, check, screenshot
from panel_steps import HEADER_CHECKBOX_OF_PANEL
from panels import PANELS, change_all, header_of, open_panel
from places import area_of


def press_motion_blur() -> Step:
    render, cycles = bpy.context.scene.render, bpy.context.scene.cycles
    y = yield from header_of(PANELS.index("Motion Blur"))
    checkbox = Button("render.use_motion_blur", y, HEADER_CHECKBOX_OF_PANEL)
    yield from change(area_of("PROPERTIES"), checkbox, render)
    render.use_motion_blur, cycles.rolling_shutter_type = True, "TOP"

    def work(buttons: list[Button]) -> Step:
        yield from change_all(render, {"motion_blur_shutter": "2", "motion_blur_position": None})(buttons)
        yield from change_all(cycles, {"rolling_shutter_duration": "0.5", "rolling_shutter_type": None})(buttons)

    yield from open_panel("Motion Blur", work)
    render.use_motion_blur, render.motion_blur_position, cycles.rolling_shutter_type = False, "CENTER", "NONE"


def render_what_moves() -> Step:
    """Render in the thread of Blender's render, which steps through the shutter by itself."""
    scene = bpy.context.scene
    before = scene.frame_current, scene.frame_subframe
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 2.0
    yield from render_and_wait()
    screenshot("render_of_what_moves")
    after = scene.frame_current, scene.frame_subframe
    check(after == before, f"a render leaves the scene at {after}, not {before}")
    yield from close_image("TEXT_EDITOR")
    scene.render.use_motion_blur = False
