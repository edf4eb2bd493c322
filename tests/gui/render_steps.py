"""Renders: the Preview button, F12, Escape, the panels that report on them, and failures."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import numpy as np
from addon_state import (
    close_image_windows,
    events,
    forget_reports,
    is_working,
    module,
    overlay,
    settings,
    wait_for_report,
)
from builds import is_building, watch_a_build, with_cloud
from buttons import find_and_press
from driver import Step, area_pixels, at_rest, check, redrawn, screenshot, wait_until
from gates import Gate, gate_of_renders
from hands import handled, hover, press_key
from places import area_of, context_of, middle_of, region_of

STATUS_BAR = 18  # pixels


def find_and_press_preview() -> Step:
    """In a panel that is laid out again."""
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    yield from redrawn()
    bpy.context.scene.render.engine = "PERFECT_BVH"
    yield from at_rest(area_of("PROPERTIES"))
    yield from find_and_press(area_of("PROPERTIES"), "perfect_bvh.preview")


def check_shows_whole(area: bpy.types.Area) -> None:
    """Check that an editor's image is entirely inside of it."""
    region, space = region_of(area), area.spaces.active
    width, height = (length * space.zoom_percentage / 100 for length in space.image.size)
    check(
        width <= region.width + 1 and height <= region.height + 1,
        f"an image of {width:.0f} x {height:.0f} in {region.width} x {region.height} pixels",
    )


def press_preview() -> Step:
    """Its image replaces the 3D viewport or is in a new window, until that is closed."""
    settings().preview_percentage = 50
    yield from find_and_press_preview()
    yield from wait_until(lambda: "Perfect BVH View" in bpy.data.images, "no image of the preview")
    yield from wait_until(lambda: not is_working(), "the preview does not end")
    yield from redrawn()
    screenshot("preview")
    check(bpy.context.scene.render.engine == "PERFECT_BVH", "Preview has changed the render engine")
    editors = [area for window in bpy.context.window_manager.windows for area in window.screen.areas]
    shown = [area for area in editors if area.type == "IMAGE_EDITOR"]
    names = [area.spaces.active.image.name for area in shown]
    check(names == ["Perfect BVH View"], f"Image Editors show {names}")
    check_shows_whole(shown[0])
    settings().preview_percentage = 100
    yield from close_image_windows()


def follow_a_preview_without_the_mouse() -> Step:
    """The status bar advances by itself."""
    view, window = bpy.context.preferences.view, bpy.context.window_manager.windows[0]
    display, view.render_display_type = view.render_display_type, "NONE"  # no window covers the bar
    samples, settings().samples, settings().use_noise_threshold = settings().samples, 65536, False
    hover(*middle_of(area_of("VIEW_3D")))
    yield from handled()
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        bpy.ops.perfect_bvh.preview("INVOKE_DEFAULT")
    bar, seen = SimpleNamespace(x=0, y=0, width=window.width, height=STATUS_BAR), set[bytes]()

    def advances() -> bool:
        seen.add(area_pixels(bar).tobytes())
        return len(seen) > 5

    yield from wait_until(advances, "the status bar stands still while a view is rendered", every=0.2)
    check(is_working(), "a view of 65,536 samples has ended")
    screenshot("preview_without_the_mouse")
    yield from press_key("Escape")
    yield from wait_until(lambda: not is_working(), "Escape does not stop the preview")
    settings().samples, settings().use_noise_threshold, view.render_display_type = samples, True, display
    yield from redrawn()


def stop_a_preview_while_it_builds() -> Step:
    """Escape before there is an image; the next one is built and shown."""
    check(overlay() is None, "boxes are drawn: they would have the trees built again as soon as they are stopped")
    name = "Perfect BVH View"
    if name in bpy.data.images:
        bpy.data.images.remove(bpy.data.images[name])

    def press(gate: Gate) -> Step:
        forget_reports()
        yield from find_and_press_preview()
        yield from watch_a_build("preview", gate)
        yield from press_key("Escape")
        yield from wait_until(lambda: not is_working(), "Escape does not stop the build of a preview")
        yield from wait_until(lambda: not is_building(), "the build goes on after Escape")
        check(name not in bpy.data.images, "a preview that was stopped while it built has made an image")
        yield from wait_for_report("Canceled before the first sample")
        gate.open()
        settings().samples, settings().preview_percentage = 2, 20
        yield from find_and_press_preview()
        yield from wait_until(lambda: name in bpy.data.images, "no image of the preview after its build")
        screenshot("preview_after_its_build")
        yield from wait_until(lambda: not is_working(), "the preview does not end")
        settings().preview_percentage = 100
        yield from close_image_windows()

    yield from with_cloud(press)


def start_render() -> None:
    """Start a render like the menu: a job in the background, shown where the user wants renders."""
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        bpy.ops.render.render("INVOKE_DEFAULT", use_viewport=True)


def render() -> Step:
    events.clear()
    status, texts = module("engine").RenderStatus, []
    send = status._send
    status._send = lambda shown, text: (texts.append(text), send(shown, text))
    start_render()
    yield from wait_until(lambda: "render_complete" in events, "the render does not end")
    status._send = send
    stages = {text.rpartition(" | ")[2].split()[0] for text in texts}
    check({"Reading", "Sample"} <= stages, f"the render says {texts}")
    check(
        module("statistics.last_result").last_statistics(bpy.context.scene) is not None, "no statistics of the render"
    )
    yield from redrawn()
    screenshot("rendered_window")
    yield from close_image_windows()


def let_statistics_come_by_themselves() -> Step:
    """Without a move of the mouse: the panels of a render come when it ends, and say when the scene is another."""
    display, bpy.context.preferences.view.render_display_type = bpy.context.preferences.view.render_display_type, "NONE"
    hover(*middle_of(area_of("VIEW_3D")))
    module("statistics.last_result").forget()
    area = area_of("PROPERTIES")
    area.tag_redraw()
    yield from handled()
    without = yield from at_rest(area)
    events.clear()
    start_render()
    yield from wait_until(lambda: "render_complete" in events, "the render does not end")
    shows = lambda pixels: np.array_equal(area_pixels(area), pixels)  # noqa: E731
    yield from wait_until(lambda: not shows(without), "the panels do not come after a render", every=0.2)
    rendered = yield from at_rest(area, 1.0)
    check(
        not module("statistics.last_result").is_outdated(bpy.context.scene), "what was just rendered is called outdated"
    )
    screenshot("statistics_by_themselves")
    yield 1.0
    check(shows(rendered), "the panels change without a reason")
    bpy.data.objects["Hill"].location.z += 0.5
    yield from wait_until(lambda: not shows(rendered), "the panels do not say that the scene is another", every=0.2)
    yield from at_rest(area)
    screenshot("statistics_of_an_edited_scene")
    bpy.data.objects["Hill"].location.z -= 0.5
    bpy.context.preferences.view.render_display_type = display
    yield from redrawn()


def cancel_a_render() -> Step:
    settings().samples = 4096
    events.clear()
    with gate_of_renders() as gate:
        gate.hold_when(lambda _, share: share > 0.0)
        start_render()
        yield from gate.wait("a render")
        check(bpy.app.is_job_running("RENDER"), "a render that is held has ended")
        screenshot("rendering")
        yield from press_key("Escape")
        yield from wait_until(lambda: not bpy.app.is_job_running("RENDER"), "Escape does not end the render")
    renders = [event for event in events if event.startswith("render")]
    check(renders == ["render_cancel"], f"events of a cancelled render: {events}")
    settings().samples = 2
    yield from redrawn()
    yield from close_image_windows()


def render_without_a_camera() -> Step:
    """Blender says so, and nothing else happens."""
    scene = bpy.context.scene
    camera, scene.camera = scene.camera, None
    events.clear()
    yield from redrawn()
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        try:
            bpy.ops.render.render()
        except RuntimeError as problem:
            check("camera" in str(problem).lower(), str(problem))
        else:
            check(False, "a render without a camera has succeeded")
    yield from redrawn()
    screenshot("no_camera")
    scene.camera = camera
    check("render_complete" not in events, "a render without a camera is complete")
    yield from close_image_windows()
