"""The tree overlay: each tree, each level, each color; it follows an animation, and stays usable with 100,000 boxes."""

from __future__ import annotations

import time

import bpy
import numpy as np
from addon_state import is_playing, measured, overlay, overlay_settings, space
from buttons import leave
from driver import Step, at_rest, check, redraw, redrawn, screen_pixels, screenshot, wait_until
from hands import handled, hover, press_key
from places import area_of, context_of, middle_of


def shown() -> object | None:
    """The drawn boxes of the top level."""
    found = overlay()
    return None if found is None or found.top_level is None else found.top_level.shown


def set_overlay(**values: object) -> Step:
    """Set properties like a script, which requests no redraw."""
    for name, value in values.items():
        setattr(overlay_settings(), name, value)
    yield from redrawn()


def show_the_top_level() -> Step:
    """Show the boxes with one of Blender's engines: they are those that our rays would meet."""
    scene = bpy.context.scene
    before, scene.render.engine = scene.render.engine, "BLENDER_WORKBENCH"
    yield from redrawn()
    check(overlay() is None, "boxes are drawn before anybody asked for them")
    pixels = screen_pixels()
    overlay_settings().show_top_level = True
    yield from wait_until(shown, "no box of the top level is drawn")
    yield from wait_until(lambda: (screen_pixels() != pixels).mean() > 0.005, "the screen shows no box", every=0.2)
    screenshot("overlay_level_2")
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        bpy.ops.wm.call_panel(name="VIEW3D_PT_overlay")
    yield from redrawn()
    screenshot("overlays_popover")
    yield from press_key("Escape")
    for level in (0, 1, 3):
        yield from set_overlay(level=level)
        yield from wait_until(lambda level=level: shown().level == level, f"level {level} is not shown")
    yield from set_overlay(use_all_to_level=True)
    yield from wait_until(lambda: shown().first_level == 0, "the levels above are not shown")
    for color in ("LEVEL", "OVERLAP", "COST"):
        yield from set_overlay(color_by=color)
        yield from at_rest(area_of("VIEW_3D"))
        screenshot(f"overlay_{color.lower()}")
    yield from set_overlay(use_all_to_level=False, color_by="LEVEL")
    scene.render.engine = before
    yield from redrawn()


def point_at_a_box() -> Step:
    """The overlay describes the object under the mouse until the mouse leaves; clicks and undo still work."""
    area = area_of("VIEW_3D")
    hover(*middle_of(area))
    yield from handled()
    hover(*(place + 2 for place in middle_of(area)))
    yield from wait_until(lambda: overlay().hovered is not None, "no box is under the mouse")
    yield from at_rest(area)
    screenshot("overlay_box_under_mouse")
    for message in ("Boxes", "Nothing"):
        bpy.ops.ed.undo_push(message=message)
    bpy.ops.ed.undo()
    yield from redrawn()
    hover(*middle_of(area))
    yield from wait_until(lambda: overlay().hovered is not None, "no box is under the mouse after an undo")
    yield from leave(area_of("PROPERTIES"))
    yield from wait_until(lambda: overlay().hovered is None, "a box is under a mouse that is elsewhere")


def show_the_active_object() -> Step:
    yield from set_overlay(show_top_level=False, color_by="LEVEL", use_all_to_level=False, level=3)
    for name in ("Hill", "Tree"):
        bpy.context.view_layer.objects.active = bpy.data.objects[name]
        yield from set_overlay(show_active=True)
        yield from wait_until(lambda: overlay() is not None and overlay().active is not None, f"no box of {name}")
        yield from wait_until(lambda: overlay().active.shown.count > 0, f"no box of {name} is drawn")
        yield from redrawn()
        screenshot(f"overlay_of_{name.lower()}")
    bpy.context.view_layer.objects.active = bpy.context.scene.camera
    area_of("VIEW_3D").tag_redraw()
    yield from wait_until(lambda: overlay().active is None, "a camera's boxes are shown")
    yield from set_overlay(show_active=False)
    yield from wait_until(lambda: overlay() is None, "the overlay is still there")


def follow_an_animation() -> Step:
    yield from set_overlay(show_top_level=True, level=3)
    yield from wait_until(shown, "no box is drawn")
    frame, boxes = bpy.context.scene.frame_current, overlay().top_level.boxes.boxes.copy()
    hover(*middle_of(area_of("VIEW_3D")))
    yield from press_key("space")
    yield from wait_until(lambda: bpy.context.scene.frame_current >= frame + 3, "the animation does not play")
    yield from press_key("space")
    yield from wait_until(lambda: not is_playing(), "the animation still plays")
    differ = lambda later: later.shape != boxes.shape or np.any(later != boxes)  # noqa: E731
    follow = lambda: differ(overlay().top_level.boxes.boxes)  # noqa: E731
    yield from wait_until(follow, "the boxes do not follow the animation")
    bpy.context.scene.frame_set(frame)
    yield from redrawn()


def draw_100000_boxes() -> Step:
    """The deepest levels of a large mesh's tree: the time of a redraw, and that Blender still responds."""
    yield from set_overlay(show_top_level=False)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=700, y_subdivisions=700, size=12.0, location=(0.0, 0.0, 6.0))
    grid = bpy.context.object
    yield from redrawn()
    yield from set_overlay(show_active=True, level=12, use_all_to_level=True)
    yield from wait_until(lambda: overlay() is not None and overlay().active is not None, "no box is drawn")
    yield from wait_until(lambda: overlay().active.shown.count == 100_000, "100,000 boxes are not drawn")
    yield from redrawn()
    screenshot("overlay_100000")
    times = []
    for _ in range(3):
        started = time.perf_counter()
        redraw()
        times.append(time.perf_counter() - started)
        yield 0.1
    measured["redraw with 100,000 boxes, ms"] = sorted(times)[1] * 1e3
    measured["redraws a second with 100,000 boxes"] = 1.0 / sorted(times)[1]
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        started = time.perf_counter()
        overlay()._follow(bpy.context, overlay_settings())
        overlay().sections(overlay_settings())
        measured["of it what does not draw, ms"] = (time.perf_counter() - started) * 1e3
    yield from set_overlay(show_active=False)
    for _ in range(3):
        started = time.perf_counter()
        redraw()
        times.append(time.perf_counter() - started)
        yield 0.1
    measured["the same redraw without them, ms"] = sorted(times[3:])[1] * 1e3
    bpy.data.objects.remove(grid)
    yield from set_overlay(use_all_to_level=False, level=2)
    space().overlay.show_overlays = True
    yield from redrawn()
