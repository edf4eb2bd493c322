"""What a user does with the add-on in a Blender with windows, step by step; blender -P steps.py, see windows.sh.

The extension is installed but not enabled, and a scene of blend_scenes is open.
"""

from __future__ import annotations

import gc
import math
import os
import sys
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from driver import (
    Step,
    StepError,
    area_of,
    check,
    click_above,
    click_property,
    context_of,
    drag,
    hover,
    middle_of,
    press_key,
    run,
    screenshot,
    wait_until,
    x_tool,
)

MODULE = "bl_ext.user_default.perfect_bvh"
SCENES = Path(os.environ["WINDOWS_SCENES"])
events: list[str] = []
measured: dict[str, float] = {}


def note(name: str):
    def handler(*_: object) -> None:
        events.append(name)

    return bpy.app.handlers.persistent(handler)


for handler_name in ("render_complete", "render_cancel", "frame_change_post"):
    getattr(bpy.app.handlers, handler_name).append(note(handler_name))


# What the add-on knows -----------------------------------------------------------------------------------------------


def module(name: str):
    return sys.modules[f"{MODULE}.{name}"]


def viewports() -> list:
    """The renderers of the regions that are shown in Rendered shading."""
    return [found for found in gc.get_objects() if type(found).__name__ == "Viewport" and found._refinement is not None]


def all_finished() -> bool:
    found = viewports()
    return bool(found) and all(viewport._refinement.is_finished for viewport in found)


def image():
    (viewport,) = viewports()
    return viewport._refinement.image.copy()


def shading() -> bpy.types.View3DShading:
    return area_of("VIEW_3D").spaces.active.shading


def region_view() -> bpy.types.RegionView3D:
    return area_of("VIEW_3D").spaces.active.region_3d


def finished(what: str) -> Step:
    yield 0.3
    yield from wait_until(all_finished, f"{what}: the viewport is not finished", 180)


# Steps ---------------------------------------------------------------------------------------------------------------


def enable() -> Step:
    check(not hasattr(bpy.types.Scene, "perfect_bvh"), "the add-on is enabled already")
    bpy.ops.preferences.addon_enable(module=MODULE)
    yield 0.5
    check(hasattr(bpy.types.Scene, "perfect_bvh"), "the add-on is not enabled")
    check(module("preferences").native_error() is None, module("preferences").native_error())
    bpy.context.scene.render.engine = "PERFECT_BVH"
    scene = bpy.context.scene
    scene.perfect_bvh.samples = 2
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 480, 270, 100
    properties = area_of("PROPERTIES").spaces.active
    properties.context = "RENDER"
    yield 1.0
    hover(*middle_of(area_of("VIEW_3D")))
    x_tool("click", 1)  # Blender swallows the first click
    yield 0.3
    bpy.ops.ed.undo_push(message="start")


def press_the_panels_buttons() -> Step:
    area, settings = area_of("PROPERTIES"), bpy.context.scene.perfect_bvh
    before = settings.use_material_colors
    yield from click_property(area, "use_material_colors")
    yield from wait_until(lambda: settings.use_material_colors is not before, "Material Colors does nothing", 5)
    yield from click_property(area, "use_material_colors")
    yield from wait_until(lambda: settings.use_material_colors is before, "Material Colors does not switch back", 5)
    yield from click_property(area, "perfect_bvh.mode")
    yield 0.5
    screenshot("menu_of_modes")
    yield from press_key("n")  # Normal
    yield from wait_until(lambda: settings.mode == "NORMAL", "the menu of modes does not choose Normal", 5)
    settings.mode = "CLAY"
    yield 0.3


def press_preview() -> Step:
    """Its image takes the place of the 3D viewport, or a window of its own, until Escape or Back to Previous."""
    engine = bpy.context.scene.render.engine
    yield from click_above(area_of("PROPERTIES"), "perfect_bvh.mode")
    yield from wait_until(lambda: "Perfect BVH Preview" in bpy.data.images, "no image of the preview")
    yield 2.0
    screenshot("preview")
    check(bpy.context.scene.render.engine == engine, "Preview has changed the render engine")
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
    check(module("engine").last_statistics(bpy.context.scene) is not None, "no statistics of the render")


def cancel_a_render() -> Step:
    scene = bpy.context.scene
    scene.perfect_bvh.samples = 4096
    events.clear()
    start_render()
    yield from wait_until(lambda: bpy.app.is_job_running("RENDER"), "the render does not begin")
    yield 1.0
    yield from press_key("Escape")
    yield from wait_until(lambda: not bpy.app.is_job_running("RENDER"), "Escape does not end the render")
    renders = [event for event in events if event.startswith("render")]
    check(renders == ["render_cancel"], f"events of a cancelled render: {events}")
    scene.perfect_bvh.samples = 2
    yield 0.3
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


def switch_to_rendered() -> Step:
    area_of("VIEW_3D").spaces.active.overlay.show_overlays = False
    shading().type = "RENDERED"
    yield from finished("first view")
    check(image()[..., 3].max() > 0.0, "the viewport's image is empty")


def orbit() -> Step:
    before = region_view().view_rotation.copy()
    x, y = middle_of(area_of("VIEW_3D"))
    yield from drag(2, (x, y), (x + 120, y + 30))
    angle = before.rotation_difference(region_view().view_rotation).angle
    check(angle > math.radians(5.0), "dragging with the middle button does not orbit")
    yield from finished("after the orbit")


def look_orthographically() -> Step:
    hover(*middle_of(area_of("VIEW_3D")))
    yield from press_key("KP_5")
    yield 0.5
    check(region_view().view_perspective == "ORTHO", "numpad 5 does nothing")
    yield from finished("orthographic view")


def look_through_the_camera() -> Step:
    yield from press_key("KP_0")
    yield 0.8
    check(region_view().view_perspective == "CAMERA", "numpad 0 does nothing")
    yield from finished("camera view")


def restrict_to_a_border() -> Step:
    whole = image()
    render_settings = bpy.context.scene.render
    render_settings.use_border = True
    render_settings.border_min_x, render_settings.border_max_x = 0.25, 0.75
    render_settings.border_min_y, render_settings.border_max_y = 0.25, 0.75
    yield from finished("border")
    part = image()
    covered = part[..., 3] > 0.0
    check(0.05 < covered.mean() < 0.4, f"the border covers {covered.mean():.2f} of the region")
    difference = abs(part - whole)[covered].max()
    check(difference < 1e-6, f"the image within a border differs by {difference}")
    screenshot("camera_border")
    render_settings.use_border = False
    yield from finished("border taken away")


def play() -> Step:
    events.clear()
    started = time.monotonic()
    yield from press_key("space")
    yield 4.0
    frames = events.count("frame_change_post")
    measured["frames per second"] = frames / (time.monotonic() - started)
    yield from press_key("space")
    yield 0.5
    check(not bpy.context.window_manager.windows[0].screen.is_animation_playing, "the animation still plays")
    check(frames >= 4, f"only {frames} frames were shown in 4 s")
    bpy.context.scene.frame_set(1)
    yield from finished("after playing")


def edit_and_undo() -> Step:
    before = image()
    obj = next(obj for obj in bpy.context.view_layer.objects if obj.type == "MESH" and not obj.modifiers)
    area = area_of("VIEW_3D")
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    bpy.ops.ed.undo_push(message="before the edit")
    yield 0.3
    with bpy.context.temp_override(**context_of(area)):
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.transform.translate(value=(0.0, 0.0, 1.5))
        bpy.ops.object.mode_set(mode="OBJECT")
        bpy.ops.ed.undo_push(message="edit")
    yield from finished("edit")
    check(abs(image() - before).max() > 0.05, "an edit does not show")
    screenshot("edited")
    hover(*middle_of(area))
    for _ in range(6):
        yield from press_key("ctrl+z")
        yield from finished("undo")
        if abs(image() - before).max() < 1e-6:
            break
    else:
        raise StepError("undoing does not bring the old image back")


def show_four_views() -> Step:
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        bpy.ops.screen.region_quadview()
    yield from finished("quad view")
    count = len([found for found in viewports() if found._refinement.is_finished])
    check(count >= 4, f"four views, but {count} renderers")
    screenshot("quad_view")
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        bpy.ops.screen.region_quadview()
    yield from finished("single view")


def open_another_file() -> Step:
    bpy.ops.wm.open_mainfile(filepath=str(SCENES / "courtyard.blend"))
    yield 1.0
    bpy.context.scene.render.engine = "PERFECT_BVH"
    bpy.context.scene.perfect_bvh.samples = 2
    area_of("VIEW_3D").spaces.active.overlay.show_overlays = False
    shading().type = "RENDERED"
    yield from finished("another file")
    gc.collect()
    check(image()[..., 3].max() > 0.0, "the other file's image is empty")


def first_image_after_an_edit() -> Step:
    """How long Blender is away for a moved object, its new image drawn and swapped."""
    obj = next(obj for obj in bpy.context.view_layer.objects if obj.type == "MESH")
    for _ in range(3):
        started = time.perf_counter()
        obj.location.z += 0.01
        bpy.context.view_layer.update()
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)
        measured["first image after an edit, ms"] = (time.perf_counter() - started) * 1e3
        yield from finished("moved object")


def disable_and_enable() -> Step:
    bpy.ops.preferences.addon_disable(module=MODULE)
    yield 1.0
    check(not hasattr(bpy.types.Scene, "perfect_bvh"), "the add-on is still there")
    screenshot("disabled")
    bpy.ops.preferences.addon_enable(module=MODULE)
    yield 1.0
    bpy.context.scene.render.engine = "PERFECT_BVH"
    shading().type = "RENDERED"
    yield from finished("enabled again")


def report() -> Step:
    for name, value in measured.items():
        print(f"MEASURED {name}: {value:.1f}", flush=True)
    yield 0.1


STEPS = (
    enable,
    press_the_panels_buttons,
    press_preview,
    render,
    cancel_a_render,
    switch_to_rendered,
    orbit,
    look_orthographically,
    look_through_the_camera,
    restrict_to_a_border,
    play,
    edit_and_undo,
    show_four_views,
    open_another_file,
    first_image_after_an_edit,
    disable_and_enable,
    report,
)

if __name__ == "__main__":
    chosen = os.environ.get("WINDOWS_STEPS")
    run([step for step in STEPS if not chosen or step.__name__ in chosen.split(",")], bpy.ops.wm.quit_blender)
