"""The tab BVH Study of the sidebar, whose panels are closed at first: opened and closed by the mouse."""

from __future__ import annotations

from collections.abc import Callable

import bpy
from buttons import Button, leave, list_buttons, toggle_panel
from driver import Step, at_rest, redrawn
from panels import PANEL_HEIGHT, photograph
from places import main_area, region_of

# In the order in which they are shown.
STUDIES = ("Scene Updates", "Display", "Compare", "Walk a Ray", "Benchmark")
FIRST_HEADER = 16  # below the region's upper end, in pixels


def open_study(area: bpy.types.Area, title: str) -> Step:
    """Show the sidebar with one panel of the tab open, all others being closed."""
    area.spaces.active.show_region_ui = True
    yield from redrawn()
    sidebar = region_of(area, "UI")
    sidebar.active_panel_category = "BVH Study"
    sidebar.tag_redraw()
    yield from at_rest(area)
    yield from toggle_panel(area, header_of(area, title))


def close_study(area: bpy.types.Area, title: str) -> Step:
    """Close the panel that is open, and the sidebar."""
    yield from leave(area)
    yield from toggle_panel(area, header_of(area, title))
    area.spaces.active.show_region_ui = False
    yield from redrawn()


def header_of(area: bpy.types.Area, title: str) -> float:
    """Where it is while all above it are closed."""
    sidebar = region_of(area, "UI")
    return sidebar.y + sidebar.height - FIRST_HEADER - PANEL_HEIGHT * STUDIES.index(title)


def with_study(title: str, work: Callable[[list[Button]], Step]) -> Step:
    """Do something with the buttons of a panel."""
    area = main_area()
    kind, area.type = area.type, "VIEW_3D"
    yield from redrawn()
    yield from open_study(area, title)
    photograph(title)
    yield from work((yield from list_buttons(area)))
    yield from close_study(area, title)
    area.type = kind
    yield from redrawn()
