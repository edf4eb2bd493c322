"""Walk a Ray: pixels are clicked, keys step and play, and it ends with Esc and with an undo; nothing is changed."""

from __future__ import annotations

from typing import Any

import bpy
from addon_state import module
from driver import Step, at_rest, check, redrawn, screen_pixels, screenshot, wait_until
from hands import click, hover, press_key
from places import area_of, context_of, middle_of, region_of


def walk() -> Any:
    """The ray walk that is shown."""
    return module("view3d.walk.walk_view").shown()


def start() -> Step:
    """In the camera's view, even if earlier steps have turned the viewport."""
    area_of("VIEW_3D").spaces.active.region_3d.view_perspective = "CAMERA"
    yield from redrawn()
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        check(bpy.ops.perfect_bvh.walk_ray("INVOKE_DEFAULT") == {"RUNNING_MODAL"}, "it does not begin")
    yield from redrawn()


def look_freely() -> Step:
    area_of("VIEW_3D").spaces.active.region_3d.view_perspective = "PERSP"
    yield from redrawn()


def maximize_and_restore() -> Step:
    for _ in range(2):
        with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
            bpy.ops.screen.screen_full_area()
        yield from at_rest(area_of("VIEW_3D"))


def click_a_pixel(across: float, up: float) -> Step:
    """Takes fractions of the viewport; returns the walk shown after the click."""
    region, before = region_of(area_of("VIEW_3D")), walk()
    yield from click(region.x + across * region.width, region.y + up * region.height)
    yield from wait_until(lambda: walk() is not None and walk() is not before, "no ray is walked")
    yield from at_rest(area_of("VIEW_3D"))
    return walk()


def walk_a_ray() -> Step:
    blocks = len(bpy.data.objects), len(bpy.data.meshes)
    yield from start()
    plain = screen_pixels()
    shown = yield from click_a_pixel(0.5, 0.25)
    check(shown.ray.walk.hit_row is not None, "the ray to the ground hits nothing")
    check((screen_pixels() != plain).mean() > 0.1, "the screen does not show the walk")
    screenshot("walk_first_step")
    hover(*middle_of(area_of("VIEW_3D")))
    for key, index in (("Right", 1), ("Right", 2), ("Left", 1), ("End", len(shown.steps) - 1), ("Home", 0)):
        yield from press_key(key)
        check(shown.index == index, f"{key} shows step {shown.index}, not {index}")
    last = len(shown.steps[0].rows) - 1
    for key, part in (("shift+Left", last - 1), ("shift+Left", last - 2), ("shift+Right", last - 1)):
        yield from press_key(key)
        check((shown.index, shown.part) == (0, part), f"{key} shows part {shown.part} of step {shown.index}")
    yield from press_key("Home")
    yield from press_key("space")
    yield from wait_until(lambda: shown.index >= 3, "it does not play")
    yield from press_key("space")
    check(not shown.is_playing and not bpy.context.screen.is_animation_playing, "it does not pause")
    yield from at_rest(area_of("VIEW_3D"))
    screenshot("walk_in_the_middle")
    other = yield from click_a_pixel(0.6, 0.3)
    yield from press_key("End")
    check(other.index == len(other.steps) - 1, "the other ray's end is not shown")
    yield from at_rest(area_of("VIEW_3D"))
    screenshot("walk_last_step")
    yield from maximize_and_restore()
    check(not other.is_old(bpy.context.scene), "a viewport that was maximized is taken for an edit")
    bpy.context.scene.camera.location.x += 0.0
    yield from wait_until(lambda: other.is_old(bpy.context.scene), "an edit is not noticed")
    yield from at_rest(area_of("VIEW_3D"))
    screenshot("walk_of_another_scene")
    yield from press_key("Escape")
    yield from wait_until(lambda: walk() is None, "Esc does not end it")
    check((len(bpy.data.objects), len(bpy.data.meshes)) == blocks, "something was changed")
    yield from look_freely()


def leave_the_workspace_while_walking() -> Step:
    yield from start()
    yield from click_a_pixel(0.5, 0.25)
    window = bpy.context.window_manager.windows[0]
    own, bar = window.workspace, module("operators.ticking")
    check(bar._is_told, "the status bar tells no keys")
    window.workspace = next(other for other in bpy.data.workspaces if other != own)
    yield from wait_until(lambda: walk() is None, "it survives another workspace")
    check(not bar._is_told, "the status bar still tells keys")
    window.workspace = own
    yield from redrawn()
    yield from look_freely()


def undo_while_walking() -> Step:
    bpy.ops.ed.undo_push(message="before")  # scripts' changes until now are in no undo step yet
    bpy.context.scene.camera.location.x += 0.01
    bpy.ops.ed.undo_push(message="moved")
    yield from start()
    yield from click_a_pixel(0.5, 0.25)
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        bpy.ops.ed.undo()
    yield from wait_until(lambda: walk() is None, "it survives an undo")
    yield from look_freely()
