"""Scene Updates, in the sidebar: rows are chosen with the mouse and select their objects; a viewport fills the list."""

from __future__ import annotations

import bpy
from addon_state import all_finished, close_image_windows, events, module, settings, space
from driver import Step, at_rest, check, redrawn, screenshot, wait_until
from hands import click, handled, hover
from places import context_of, main_area, region_of
from render_steps import start_render
from studies import close_study, open_study

ROW = 20  # the height of one, at the resolution scale that a new user has
STEP = 5
COLUMN = 0.2  # of the sidebar's width
MANY_SAMPLES = 4096


def is_of_list(area: bpy.types.Area) -> bool:
    """Whether a row of the list is under the mouse."""
    with bpy.context.temp_override(**context_of(area) | {"region": region_of(area, "UI")}):
        found = bpy.context.property
        return found is not None and found[0] == bpy.context.window_manager and found[1].endswith(".active")


def find_rows(area: bpy.types.Area, x: float) -> Step:
    """Returns the heights of the list's upper and lower end."""
    sidebar, found = region_of(area, "UI"), []
    for y in range(sidebar.y + sidebar.height - STEP, sidebar.y, -STEP):
        hover(x, y)
        yield from handled()
        if is_of_list(area):
            found.append(y)
        elif found and found[-1] - y > STEP:  # not the edge between two rows
            break
    check(found, "there is no list in the sidebar")
    return found[0], found[-1]


def choose_rows_of_what_was_updated() -> Step:
    """A render that had everything to build is listed by itself once the panel is seen."""
    area, layer, scene = main_area(), bpy.context.view_layer, bpy.context.scene
    module("live.sync_cache").clear_syncs()
    events.clear()
    start_render()
    yield from wait_until(lambda: "render_complete" in events, "the render does not end")
    yield from close_image_windows()
    yield from open_study(area, "Scene Updates")
    sidebar = region_of(area, "UI")
    rows_of = module("statistics.update_list").rows_of
    yield from wait_until(lambda: rows_of(scene) is not None and len(rows_of(scene).rows) > 3, "nothing is listed")
    yield from at_rest(area)
    screenshot("what_was_updated")
    rows, x = rows_of(scene), sidebar.x + COLUMN * sidebar.width
    top, bottom = yield from find_rows(area, x)
    check((top - bottom) / ROW > 2, f"the list has {(top - bottom) / ROW:.1f} rows")
    for number in (1, 0):
        for obj in layer.objects:
            obj.select_set(False)
        yield from click(x, top - (number + 0.5) * ROW)
        yield from wait_until(lambda number=number: rows.active == number, f"row {number} cannot be chosen")
        check(rows.note or bpy.context.selected_objects, f"{rows.rows[number].name} selects nothing")
        check(rows.done and rows.advice, f"nothing is said of {rows.rows[number].name}")
    yield from redrawn()
    screenshot("a_row_of_what_was_updated")
    yield from close_study(area, "Scene Updates")


def list_a_viewports_first_image() -> Step:
    """The list comes with the first full image, while a viewport still has most of its samples to trace."""
    area, scene = main_area(), bpy.context.scene
    lists, results = module("statistics.update_list"), module("statistics.last_result")
    results.forget()
    module("live.sync_cache").clear_syncs()
    before, settings().samples = settings().samples, MANY_SAMPLES
    yield from open_study(area, "Scene Updates")
    check(results.last_statistics(scene) is None, "there are figures before there is an image")
    screenshot("nothing_was_updated")

    def is_listed() -> bool:
        known = lists._listed.get(scene.session_uid)
        return known is not None and known[0] is results.last_statistics(scene) and bool(lists.rows_of(scene).rows)

    space().shading.type = "RENDERED"
    yield from wait_until(is_listed, "nothing is listed")
    check(not all_finished(), f"{MANY_SAMPLES} samples are traced already")
    yield from redrawn()
    screenshot("updates_of_a_viewport")
    space().shading.type = "SOLID"
    settings().samples = before
    yield from close_study(area, "Scene Updates")
