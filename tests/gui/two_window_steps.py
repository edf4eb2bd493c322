"""Two scenes in two windows: each shows its own, complete; and renders of a scene that is removed during the render."""

from __future__ import annotations

import gc
import subprocess

import bpy
import numpy as np
from addon_state import events, finished, module, viewports
from driver import Step, StepError, check, redrawn, screenshot, wait_until
from gates import Gate, gate_of_renders
from hands import handled, hover, press_key
from places import middle_of, window_stands, work_in_window
from shown_images import SECOND_WINDOW, check_shows, main_window, override, show_plainly, view_areas


def second_window() -> bpy.types.Window:
    return bpy.context.window_manager.windows[1]


def blender_windows() -> list[str]:
    """The X server's numbers of all of Blender's windows."""
    command = ["xdotool", "search", "--onlyvisible", "--class", "blender"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()


def place_window(window: str, left: int, top: int, width: int, height: int) -> Step:
    """Blender places a window itself once it is there, so this may take more than one attempt."""
    wanted = f"X={left}\nY={top}\nWIDTH={width}\nHEIGHT={height}\n"
    for _ in range(10):
        place = ["windowsize", window, str(width), str(height), "windowmove", window, str(left), str(top)]
        # Not by `x_tool`, which may send the last word only with its next one, when the window is gone.
        subprocess.run(["xdotool", *place], check=True)
        work_in_window(1)
        yield from window_stands()
        work_in_window(0)
        command = ["xdotool", "getwindowgeometry", "--shell", window]
        found = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        if wanted in found:
            return
    raise StepError(f"the second window is not where it should be: {found}")


def open_second_window() -> Step:
    """A second main window, where the first one leaves the screen free."""
    before = blender_windows()
    with bpy.context.temp_override(window=main_window()):
        bpy.ops.wm.window_new_main()
    new = lambda: set(blender_windows()) - set(before)  # noqa: E731
    yield from wait_until(new, "there is no second window")
    (made,) = new()
    yield from place_window(made, **SECOND_WINDOW)


def make_second_scene() -> bpy.types.Scene:
    """Boxes in a row, and of the first scene's objects the hill."""
    scene = bpy.data.scenes.new("Other")
    scene.render.engine = "PERFECT_BVH"
    scene.perfect_bvh.mode, scene.perfect_bvh.samples = "CLAY", 4
    scene.collection.objects.link(bpy.data.objects["Hill"])
    mesh = bpy.data.meshes.new("Box")
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 3)]
    mesh.from_pydata(corners, [], [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
    for number in range(5):
        box = bpy.data.objects.new(f"Box {number}", mesh)
        box.location = (3.0 * number - 6.0, 0.0, 4.0)
        scene.collection.objects.link(box)
    return scene


def show_two_scenes_in_two_windows() -> Step:
    yield from open_second_window()
    first, second = main_window(), second_window()
    second.scene = make_second_scene()
    yield from redrawn()
    check(first.scene != second.scene, "both windows show one scene")
    (area,) = view_areas(second)
    show_plainly(area)
    with override(second, area):
        bpy.ops.view3d.view_all()
    yield from finished("two scenes")
    yield from check_shows(first, view_areas(first)[0], "first window")
    yield from check_shows(second, view_areas(second)[0], "second window")
    screenshot("two_scenes")


def edit_in_two_scenes() -> Step:
    """Edits of one scene's objects leave the other's image unchanged; edits of shared objects show in both."""
    first, second = main_window(), second_window()
    images = {}

    def look(what: str) -> Step:
        yield from finished(what)
        for window in (first, second):
            name = window.scene.name
            images[name] = yield from check_shows(window, view_areas(window)[0], f"{what}, {name}")

    yield from look("before")
    before, kept = dict(images), {id(found._refinement) for found in viewports()}
    bpy.data.objects["Box 2"].location.z += 2.0
    yield from look("a box of the second scene moved")
    check(np.array_equal(images[first.scene.name], before[first.scene.name]), "the first scene shows the second's edit")
    check(abs(images["Other"] - before["Other"]).max() > 0.05, "the second scene does not show its edit")
    check(kept & {id(found._refinement) for found in viewports()}, "the first scene's image was restarted")
    before = dict(images)
    bpy.data.objects["Hill"].location.z -= 1.0
    yield from look("the hill of both scenes moved")
    for name, image in before.items():
        check(abs(images[name] - image).max() > 0.05, f"{name} does not show the edit of what both scenes have")
    bpy.data.objects["Hill"].location.z += 1.0
    yield from look("the hill is back")
    for name, image in before.items():
        check(np.array_equal(images[name], image), f"{name} is not as before")


# Renders whose scene or window goes ----------------------------------------------------------------------------------


def start_render_of(window: bpy.types.Window, gate: Gate) -> Step:
    """Start a render that goes on until Blender or the gate ends it."""
    scene = window.scene
    if scene.camera is None:
        scene.camera = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
        scene.camera.location = (0.0, 0.0, 30.0)
        scene.collection.objects.link(scene.camera)
    scene.perfect_bvh.samples = 4096
    events.clear()
    gate.hold_when(lambda _, share: share > 0.0)
    with override(window, view_areas(window)[0]):
        bpy.ops.render.render("INVOKE_DEFAULT")
    yield from gate.wait("a render")
    check(bpy.app.is_job_running("RENDER"), "a render that is held has ended")


def close_a_window_while_it_renders() -> Step:
    """The render goes on or ends, as Blender likes it; Escape ends it at the latest."""
    bpy.context.preferences.view.render_display_type = "NONE"
    first, second = main_window(), second_window()
    with gate_of_renders() as gate:
        yield from start_render_of(second, gate)
        second.scene.perfect_bvh.samples = 4  # of viewports; the render has read its own
        with bpy.context.temp_override(window=second):
            bpy.ops.wm.window_close()
        yield from redrawn()
        check(len(bpy.context.window_manager.windows) == 1, "the window is still there")
        if bpy.app.is_job_running("RENDER"):
            hover(*middle_of(view_areas(first)[0]))
            yield from handled()
            yield from press_key("Escape")
        yield from wait_until(lambda: not bpy.app.is_job_running("RENDER"), "the render goes on")
    gc.collect()
    yield from finished("the window that stays")
    yield from check_shows(first, view_areas(first)[0], "the window that stays")


def delete_a_scene_while_it_renders() -> Step:
    first, other = main_window(), bpy.data.scenes["Other"]
    kept, uid = first.scene, other.session_uid
    first.scene = other
    show_plainly(view_areas(first)[0])
    yield from finished("the other scene in the window that stays")
    with gate_of_renders() as gate:
        yield from start_render_of(first, gate)
        with override(first, view_areas(first)[0]):
            bpy.ops.scene.delete()
        yield from wait_until(lambda: not bpy.app.is_job_running("RENDER"), "the render of a deleted scene goes on")
    check("Other" not in bpy.data.scenes, "the scene is still there")
    first.scene = kept
    show_plainly(view_areas(first)[0])
    gc.collect()
    yield from finished("the scene that stays")
    yield from check_shows(first, view_areas(first)[0], "the scene that stays")
    check(all(key[0] != uid for key in module("live.sync_cache")._syncs), "what was synced of a deleted scene is kept")
    bpy.context.preferences.view.render_display_type = "WINDOW"
