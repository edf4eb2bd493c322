"""Windows, their areas and regions, and where those are."""

from __future__ import annotations

import time

import bpy
from driver import Step, StepError, check

_front = 0


def front_window() -> bpy.types.Window:
    """The window with the mouse, in which areas are searched for."""
    return bpy.context.window_manager.windows[_front]


def work_in_window(number: int) -> None:
    """From now on the mouse is in this window, numbered in the order of opening."""
    global _front
    _front = number


def window_stands() -> Step:
    """Wait until the window in front keeps its position and size: it opens somewhere, and is moved then."""
    place, since = None, 0.0
    for _ in range(600):
        window = front_window()
        now = window.x, window.y, window.width, window.height
        if now != place:
            place, since = now, time.monotonic()
        elif time.monotonic() > since + 0.5:
            return
        yield 0.1
    raise StepError("a window does not come to rest")


def area_of(kind: str) -> bpy.types.Area:
    """The largest area of a type."""
    areas = [area for area in front_window().screen.areas if area.type == kind]
    check(areas, f"no area of type {kind}")
    return max(areas, key=lambda area: area.width * area.height)


def main_area() -> bpy.types.Area:
    """The largest, in which the 3D viewport is wont to be."""
    return max(bpy.context.window_manager.windows[0].screen.areas, key=lambda area: area.width * area.height)


def region_of(area: bpy.types.Area, kind: str = "WINDOW") -> bpy.types.Region:
    return next(region for region in area.regions if region.type == kind)


def panel_region(area: bpy.types.Area) -> bpy.types.Region:
    """Where its panels are."""
    return region_of(area, "UI" if area.type == "VIEW_3D" else "WINDOW")


def middle_of(area: bpy.types.Area) -> tuple[float, float]:
    region = region_of(area)
    return region.x + region.width / 2, region.y + region.height / 2


def context_of(area: bpy.types.Area) -> dict[str, object]:
    """The arguments of `temp_override` for an area."""
    return {"window": front_window(), "area": area, "region": region_of(area)}
