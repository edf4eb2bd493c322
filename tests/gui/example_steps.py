"""The example files as a new user tries them: opened Rendered, F12, a scan, a failure case that is played."""

from __future__ import annotations

import bpy
from addon_state import (
    close_image_windows,
    events,
    finished,
    forget_reports,
    is_playing,
    is_working,
    settings,
    space,
    wait_for_report,
)
from driver import Step, area_pixels, at_rest, check, redrawn, screenshot, wait_until
from hands import handled, hover, press_key
from places import area_of, middle_of
from tree_steps import differ, open_sidebar, press_in_sidebar

# By its place on the keyboard: by its name xdotool presses Alt as well.
F12 = "96"


def open_example(name: str) -> Step:
    """One of blend_scenes/, which comes with its own screen."""
    folder = bpy.data.filepath.rpartition("blend_scenes")[0]
    bpy.ops.wm.open_mainfile(filepath=f"{folder}blend_scenes/{name}.blend")
    yield from redrawn()
    check(bpy.context.scene.render.engine == "PERFECT_BVH", f"{name} has {bpy.context.scene.render.engine}")
    check(space().shading.type == "RENDERED", f"{name} opens in {space().shading.type}")
    check(space().region_3d.view_perspective == "CAMERA", f"{name} is not seen through its camera")


def press_f12_in_an_example() -> Step:
    yield from open_example("gears")
    render = bpy.context.scene.render
    render.resolution_percentage, settings().samples = 25, 2
    yield from finished("gears")
    hover(*middle_of(area_of("VIEW_3D")))
    yield from handled()
    events.clear()
    yield from press_key(F12)
    yield from wait_until(lambda: "render_complete" in events, "F12 does not render")
    yield from redrawn()
    screenshot("f12_in_an_example")
    yield from close_image_windows()


def keep_the_interface() -> Step:
    """As the user may want it of all renders: then a line says which image holds the view."""
    view = bpy.context.preferences.view
    before, view.render_display_type = view.render_display_type, "NONE"
    settings().preview_percentage = 20
    forget_reports()
    hover(*middle_of(area_of("VIEW_3D")))
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area_of("VIEW_3D")):
        bpy.ops.perfect_bvh.preview("INVOKE_DEFAULT")
    yield from wait_until(lambda: not is_working(), "the view is not rendered to its end")
    yield from wait_for_report('The view is in the image "Perfect BVH View": open an Image Editor to see it')
    check(len(bpy.context.window_manager.windows) == 1, "a window was opened")
    check(not any(area.type == "IMAGE_EDITOR" for area in bpy.context.screen.areas), "an editor was changed")
    view.render_display_type, settings().preview_percentage = before, 100


def scan_an_example() -> Step:
    """The points are visible at once, in their colours, with any shading of the viewport."""
    area = area_of("VIEW_3D")
    chosen = bpy.context.view_layer.objects.active, bpy.context.selected_objects
    yield from open_sidebar(area)
    yield from finished("gears next to the sidebar")
    hover(*middle_of(area))
    yield from handled()
    before = yield from at_rest(area)
    yield from press_in_sidebar(area, "perfect_bvh.scan")
    yield from wait_until(lambda: "Scan" in bpy.data.objects, "the scan makes no object")
    check(chosen == (bpy.context.view_layer.objects.active, bpy.context.selected_objects), "the selection is another")
    shows = lambda: differ(area_pixels(area), before) > 0.1  # noqa: E731
    yield from wait_until(shows, "the points are not seen in Rendered shading", every=0.2)
    screenshot("scan_of_an_example")
    space().shading.type = "SOLID"
    for item in bpy.context.scene.objects:
        item.hide_set(item.name != "Scan")
    with_points = yield from at_rest(area)
    screenshot("points_in_solid")
    bpy.data.objects["Scan"].hide_set(True)
    without = yield from at_rest(area)
    check(differ(with_points, without) > 0.1, "the points are not seen in Solid shading")


def play_a_failure_case() -> Step:
    yield from open_example("zoo/twist")
    yield from finished("twist")
    editor = area_of("TEXT_EDITOR").spaces.active
    check(editor.top == 0, f"the text is scrolled by {editor.top} lines")
    picture = area_of("IMAGE_EDITOR").spaces.active.image
    check(picture.name == "The usual method: refit only", f"next to the view is {picture.name}")
    screenshot("failure_case")
    scene, first = bpy.context.scene, bpy.context.scene.frame_current
    hover(*middle_of(area_of("VIEW_3D")))
    yield from handled()
    yield from press_key("space")
    yield from wait_until(is_playing, "Space does not play")
    yield from wait_until(lambda: scene.frame_current not in {first, scene.frame_start}, "no frame comes")
    yield from press_key("space")
    yield from wait_until(lambda: not is_playing(), "Space does not stop")
