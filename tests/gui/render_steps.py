"""Renders: the Preview button, F12, Escape, the panels that tell of them, and what goes wrong."""

from __future__ import annotations

import bpy
from addon_state import events, module, settings
from buttons import find_and_press
from driver import Step, area_of, check, context_of, press_key, screenshot, wait_until


def press_preview() -> Step:
    """Its image takes the place of the 3D viewport, or a window of its own, until that is closed."""
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    yield 0.5
    bpy.context.scene.render.engine = "PERFECT_BVH"
    yield from find_and_press(area_of("PROPERTIES"), "perfect_bvh.preview")
    yield from wait_until(lambda: "Perfect BVH Preview" in bpy.data.images, "no image of the preview")
    yield 3.0
    screenshot("preview")
    check(bpy.context.scene.render.engine == "PERFECT_BVH", "Preview has changed the render engine")
    editors = [area for window in bpy.context.window_manager.windows for area in window.screen.areas]
    shown = [area.spaces.active.image.name for area in editors if area.type == "IMAGE_EDITOR"]
    check(shown == ["Perfect BVH Preview"], f"Image Editors show {shown}")
    yield from close_image_windows()


def start_render() -> None:
    """As the menu does it: a job in the background, shown where the user wants renders."""
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        bpy.ops.render.render("INVOKE_DEFAULT", use_viewport=True)


def render() -> Step:
    events.clear()
    start_render()
    yield from wait_until(lambda: "render_complete" in events, "the render does not end", 60)
    yield 0.5
    check(module("latest").last_statistics(bpy.context.scene) is not None, "no statistics of the render")
    screenshot("rendered_window")
    yield from close_image_windows()


def cancel_a_render() -> Step:
    settings().samples = 4096
    events.clear()
    start_render()
    yield from wait_until(lambda: bpy.app.is_job_running("RENDER"), "the render does not begin")
    yield 1.0
    screenshot("rendering")
    yield from press_key("Escape")
    yield from wait_until(lambda: not bpy.app.is_job_running("RENDER"), "Escape does not end the render")
    renders = [event for event in events if event.startswith("render")]
    check(renders == ["render_cancel"], f"events of a cancelled render: {events}")
    settings().samples = 2
    yield 0.3
    yield from close_image_windows()


def render_without_a_camera() -> Step:
    """Blender says so, and nothing else happens."""
    scene = bpy.context.scene
    camera, scene.camera = scene.camera, None
    events.clear()
    yield 0.3
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        try:
            bpy.ops.render.render()
        except RuntimeError as problem:
            check("camera" in str(problem).lower(), str(problem))
        else:
            check(False, "a render without a camera has succeeded")
    yield 0.5
    screenshot("no_camera")
    scene.camera = camera
    check("render_complete" not in events, "a render without a camera is complete")
    yield from close_image_windows()


def close_image_windows() -> Step:
    """Renders open a window of their own, or take the place of an area."""
    for window in list(bpy.context.window_manager.windows)[1:]:
        with bpy.context.temp_override(window=window):
            bpy.ops.wm.window_close()
    yield 0.5
    for area in bpy.context.window_manager.windows[0].screen.areas:
        if area.type == "IMAGE_EDITOR":
            area.type = "VIEW_3D"
    yield 0.5
