"""Looking into trees: two compared side by side, which their cross ends."""

from __future__ import annotations

from typing import Any

import bpy
from addon_state import is_working, module, overlay_settings, wait_for_report
from driver import Step, area_pixels, check, redrawn, screenshot, wait_until
from gates import always, gate_of_builds
from hands import click, handled, hover, press_here, press_key
from places import context_of, main_area, region_of
from studies import close_study, open_study

STEP = 8  # less than half of a button


def open_sidebar(area: bpy.types.Area) -> Step:
    area.spaces.active.show_region_ui = True
    yield from redrawn()
    sidebar = region_of(area, "UI")
    sidebar.active_panel_category = "Perfect BVH"
    sidebar.tag_redraw()
    yield from redrawn()


def call_in_sidebar(area: bpy.types.Area) -> str:
    """Return the call of the operator whose button is under the mouse; "" where there is none."""
    with bpy.context.temp_override(**context_of(area) | {"region": region_of(area, "UI")}):
        if not bpy.ops.ui.copy_python_command_button.poll():
            return ""
        bpy.ops.ui.copy_python_command_button()
    return bpy.context.window_manager.clipboard


def press_in_sidebar(area: bpy.types.Area, call: str) -> Step:
    """An operator's button, searched for from above."""
    sidebar = region_of(area, "UI")
    for y in range(sidebar.y + sidebar.height - STEP, sidebar.y, -STEP):
        hover(sidebar.x + 0.5 * sidebar.width, y)
        yield from handled()
        if f"{call}(" in call_in_sidebar(area):
            yield from press_here()
            return
    raise AssertionError(f"no button of {call} in the sidebar")


def click_cross(area: bpy.types.Area, right: float, top: float) -> Step:
    """Click the cross in the corner of the legend, by the corner's place in the region."""
    region, rect = region_of(area), module("view3d.legend").close_rect(right, top)
    yield from click(region.x + (rect.left + rect.right) / 2, region.y + (rect.bottom + rect.top) / 2)


def differ(one: Any, other: Any) -> float:
    """The share of bytes that do."""
    return float((one != other).mean())


def compare_two_trees() -> Step:
    area, view = main_area(), module("view3d.compare.compare_view")
    bpy.context.view_layer.objects.active = bpy.data.objects["Tree"]
    yield from open_study(area, "Compare")
    before = area_pixels(area)
    with gate_of_builds() as gate:
        gate.hold_when(always)
        yield from press_in_sidebar(area, "perfect_bvh.compare")
        yield from gate.wait("building two trees")
        yield from press_key("Escape")
        yield from wait_for_report("Comparison canceled")
    check(view.shown() is None and not is_working(), "comparing was stopped, but goes on")
    yield from press_in_sidebar(area, "perfect_bvh.compare")
    yield from wait_until(view.shown, "no trees are shown")
    yield from wait_until(lambda: view._regions, "the two trees are not drawn")
    shows = lambda: differ(area_pixels(area), before) > 0.3  # noqa: E731
    yield from wait_until(shows, "the viewport does not show two trees", every=0.2)
    (found,) = view._regions.values()
    check([half.count > 20 for half in found.halves] == [True, True], "a half has hardly any boxes")
    screenshot("compare")
    counts = [half.count for half in found.halves]
    overlay_settings().level += 1
    yield from wait_until(lambda: counts != [half.count for half in found.halves], "the level stays", every=0.2)
    overlay_settings().level -= 1
    free = module("view3d.drawing").free_rect(area, region_of(area))
    yield from click_cross(area, free.right, free.top)
    yield from wait_until(lambda: view.shown() is None, "the cross does not end the comparison")
    yield from close_study(area, "Compare")
