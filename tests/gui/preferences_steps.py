"""Edit > Preferences > Add-ons: the add-on's entry, found, opened and filled in by mouse and keyboard."""

from __future__ import annotations

import bpy
from addon_state import MODULE, module
from buttons import change, list_buttons, press
from drawn import OF_PREFERENCES
from driver import Step, check, redrawn, screenshot, wait_until
from hands import click, press_key, type_text
from places import area_of, front_window, region_of, window_stands, work_in_window

EDIT_MENU = (79, 14)  # from the upper left
ADD_ONS_BELOW_TOP = 229  # the middle of the section's button
# Positions of the search field and an entry's arrow in the region's width; how far down rows begin.
SEARCH, UNFOLD = 0.3, 0.03
FIRST_ROW, SECOND_ROW = 36, 70


def open_the_preferences() -> Step:
    """Open them by the menu; the mouse is in their window afterwards."""
    windows = bpy.context.window_manager.windows
    count = len(windows)
    yield from click(EDIT_MENU[0], front_window().height - EDIT_MENU[1])
    yield from press_key("p")
    yield from wait_until(lambda: len(windows) > count, "the menu opens no preferences")
    work_in_window(count)
    yield from window_stands()
    area = area_of("PREFERENCES")
    sections = region_of(area, "UI")
    for _ in range(2):  # the first click may only bring the window forward
        yield from click(sections.x + sections.width / 2, front_window().height - ADD_ONS_BELOW_TOP)
        if bpy.context.preferences.active_section == "ADDONS":
            return
    check(False, "the section of add-ons does not open")


def unfold_the_entry() -> Step:
    """Searched for by name; returns the buttons of its preferences by their names."""
    area = area_of("PREFERENCES")
    region = region_of(area)
    top = region.y + region.height
    (search,) = yield from list_buttons(area, top=top - 6, bottom=top - FIRST_ROW, column=SEARCH)
    yield from press(area, search)
    yield from type_text("perfect")
    yield from press_key("Return")
    found = yield from list_buttons(area, top=top - FIRST_ROW, bottom=top - SECOND_ROW, column=UNFOLD)
    arrows = [button for button in found if "addon_expand(" in button.what]
    check(len(arrows) == 1 and MODULE in arrows[0].what, f"the search finds {found}")
    yield from press(area, arrows[0])
    buttons = yield from list_buttons(area, top=top - SECOND_ROW)
    return {button.what: button for button in buttons}


def press_the_preferences() -> Step:
    import perfect_bvh

    count, cache = perfect_bvh.thread_count(), module("live.sync_cache")
    preferences = bpy.context.preferences.addons[MODULE].preferences
    yield from open_the_preferences()
    buttons = yield from unfold_the_entry()
    area = area_of("PREFERENCES")
    screenshot("preferences")

    def look_at_threads() -> None:
        check(perfect_bvh.thread_count() == 1, "the preference of threads does nothing")

    def look_at_cache() -> None:
        check(cache.cache_byte_limit() == 100 << 20, f"the limit is {cache.cache_byte_limit()} bytes, not 100 MB")
        screenshot("preferences_changed")

    texts = {
        "threads": ("1", look_at_threads),
        "cache_size": ("100", look_at_cache),
    }
    for name, (text, look) in texts.items():
        found = buttons.get(f"{OF_PREFERENCES}{name}")
        check(found is not None, f"no button of {name} among {list(buttons)}")
        yield from change(area, found, preferences, text, look)
    check(perfect_bvh.thread_count() == count, "the threads do not come back")
    check(cache.cache_byte_limit() == preferences.cache_size << 20, "the limit does not come back")
    work_in_window(0)
    for window in list(bpy.context.window_manager.windows)[1:]:
        with bpy.context.temp_override(window=window):
            bpy.ops.wm.window_close()
    yield from redrawn()
