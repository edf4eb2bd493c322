"""Renders: the Preview button, F12, Escape, the panels that tell of them, and what goes wrong."""

from __future__ import annotations

import subprocess

import bpy
from addon_state import close_image_windows, events, is_working, module, settings, wait_for_report
from builds import is_building, watch_a_build, with_cloud
from buttons import find_and_press
from driver import Step, area_of, check, context_of, hover, middle_of, press_key, screenshot, wait_until


def find_and_press_preview() -> Step:
    """On a loaded machine Blender may need longer than the mouse waits for it."""
    for attempt in range(3):
        bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
        yield 0.5
        bpy.context.scene.render.engine = "PERFECT_BVH"
        yield 0.5
        try:
            yield from find_and_press(area_of("PROPERTIES"), "perfect_bvh.preview")
        except AssertionError:
            if attempt == 2:
                raise
        else:
            return


def press_preview() -> Step:
    """Its image takes the place of the 3D viewport, or a window of its own, until that is closed."""
    yield from find_and_press_preview()
    yield from wait_until(lambda: "Perfect BVH Preview" in bpy.data.images, "no image of the preview")
    yield 3.0
    screenshot("preview")
    check(bpy.context.scene.render.engine == "PERFECT_BVH", "Preview has changed the render engine")
    editors = [area for window in bpy.context.window_manager.windows for area in window.screen.areas]
    shown = [area.spaces.active.image.name for area in editors if area.type == "IMAGE_EDITOR"]
    check(shown == ["Perfect BVH Preview"], f"Image Editors show {shown}")
    yield from close_image_windows()


def stop_a_preview_while_it_builds() -> Step:
    """Escape before there is an image; the next one is built and shown."""
    name = "Perfect BVH Preview"
    if name in bpy.data.images:
        bpy.data.images.remove(bpy.data.images[name])

    def press() -> Step:
        yield from find_and_press_preview()
        yield from watch_a_build("preview")
        yield from press_key("Escape")
        yield from wait_until(lambda: not is_working(), "Escape does not stop the build of a preview", 10)
        check(not is_building(), "the build goes on after Escape")
        check(name not in bpy.data.images, "a preview that was stopped while it built has made an image")
        yield from wait_for_report("The preview was stopped before there was an image")
        settings().samples, settings().preview_percentage = 2, 20
        yield from find_and_press_preview()
        yield from wait_until(lambda: name in bpy.data.images, "no image of the preview after its build", 120)
        screenshot("preview_after_its_build")
        yield from wait_until(lambda: not is_working(), "the preview does not end", 60)
        settings().preview_percentage = 100
        yield from close_image_windows()

    yield from with_cloud(press)


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


def panel_pixels() -> bytes:
    """What the screen shows of the Properties editor."""
    area = area_of("PROPERTIES")
    window = bpy.context.window_manager.windows[0]
    shape = f"{area.width}x{area.height}+{area.x}+{window.height - area.y - area.height}"
    command = ["import", "-window", "root", "-crop", shape, "-depth", "8", "rgb:-"]
    return subprocess.run(command, check=True, capture_output=True).stdout


def let_statistics_come_by_themselves() -> Step:
    """Nobody moves the mouse: the panels of a render come when it ends, and say when the scene is another."""
    display, bpy.context.preferences.view.render_display_type = bpy.context.preferences.view.render_display_type, "NONE"
    hover(*middle_of(area_of("VIEW_3D")))
    module("latest").forget()
    area_of("PROPERTIES").tag_redraw()
    yield 1.0
    without = panel_pixels()
    events.clear()
    start_render()
    yield from wait_until(lambda: "render_complete" in events, "the render does not end", 60)
    yield 1.0
    rendered = panel_pixels()
    check(rendered != without, "the panels do not come after a render")
    check(not module("latest").is_outdated(bpy.context.scene), "what was just rendered is called outdated")
    screenshot("statistics_by_themselves")
    yield 1.0
    check(panel_pixels() == rendered, "the panels change without a reason")
    bpy.data.objects["Hill"].location.z += 0.5
    yield from wait_until(lambda: panel_pixels() != rendered, "the panels do not say that the scene is another", 5)
    yield 0.7
    screenshot("statistics_of_an_edited_scene")
    bpy.data.objects["Hill"].location.z -= 0.5
    bpy.context.preferences.view.render_display_type = display
    yield 0.5


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
