"""The buttons of a Properties editor, or of a 3D viewport's sidebar: found with the mouse, pressed as their kinds ask.

Under the mouse, a property's button gives its data path, an operator's button its call. The position of a closed
panel's header is only known from the height of those above.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy
from drawn import OF_PREFERENCES, note_drawn, note_pressed
from driver import Step, at_rest, check, redrawn, wait_until
from hands import handled, hover, press_here, press_key, type_text
from places import context_of, panel_region

# In pixels, at the resolution scale that a new user has.
STEP = 9  # less than half of a button
HEADER_HEIGHT = 26
FIRST_HEADER = 32  # below the middle of the last button of the panel above
COLUMN = 0.75  # of the region's width: labels are left of it


@dataclass(frozen=True, slots=True)
class Button:
    """what: the end of a property's data path from its scene or view layer, or an operator's call. y: in the window.

    column: where it is in the width of its region.
    """

    what: str
    y: float
    column: float = COLUMN


def button_under_mouse(area: bpy.types.Area) -> str | None:
    with bpy.context.temp_override(**context_of(area) | {"region": panel_region(area)}):
        found = bpy.context.property
        if found is not None:
            is_preference = isinstance(found[0], bpy.types.AddonPreferences)
            return f"{OF_PREFERENCES}{found[1]}" if is_preference else found[1]
        if not bpy.ops.ui.copy_python_command_button.poll():
            return None
        bpy.ops.ui.copy_python_command_button()
    return bpy.context.window_manager.clipboard


def leave(area: bpy.types.Area) -> Step:
    """Up into the area's header: the last button stays active until the mouse has left its region."""
    hover(area.x + area.width / 2, area.y + area.height - 4)
    yield from handled()


def list_buttons(
    area: bpy.types.Area, top: float | None = None, bottom: float | None = None, column: float = COLUMN
) -> Step:
    """Returns the buttons between two heights, in their order; the whole region's without them."""
    note_drawn()
    region = panel_region(area)
    x = region.x + region.width * column
    y = region.y + region.height - STEP if top is None else top
    end = region.y + STEP if bottom is None else bottom
    rows: dict[str, list[float]] = {}
    yield from leave(area)
    while y > end:
        hover(x, y)
        yield from handled()
        found = button_under_mouse(area)
        if found is not None:
            rows.setdefault(found, []).append(y)
        y -= STEP
    return [Button(what, sum(heights) / len(heights), column) for what, heights in rows.items()]


def find_button(area: bpy.types.Area, what: str, column: float = COLUMN) -> Step:
    """Returns the button of a property or an operator, by the end of its data path or a part of its call."""
    buttons = yield from list_buttons(area, column=column)
    for button in buttons:
        if button.what.endswith(what) or f"{what}(" in button.what:
            return button
    raise AssertionError(f"no button of {what} among {[button.what for button in buttons]}")


def point_at(area: bpy.types.Area, button: Button) -> Step:
    region = panel_region(area)
    yield from leave(area)
    hover(region.x + region.width * button.column, button.y)
    yield from handled()
    found = button_under_mouse(area)
    check(found == button.what, f"the mouse is over {found}, not {button.what}")
    note_pressed(button.what)


def press(area: bpy.types.Area, button: Button) -> Step:
    yield from point_at(area, button)
    yield from press_here()


def find_and_press(area: bpy.types.Area, what: str, column: float = COLUMN) -> Step:
    button = yield from find_button(area, what, column)
    yield from press(area, button)


# Properties ----------------------------------------------------------------------------------------------------------


def change(
    area: bpy.types.Area,
    button: Button,
    owner: object,
    text: str | None = None,
    look: Callable[[], object] = lambda: None,
) -> Step:
    """Change a property of `owner` by its button, check that it has changed, and restore the old value.

    text: to type into a field; without it numbers increase by one. look: called before the old value is restored, to
    check the effects of the new one.
    """
    name = button.what.rpartition(".")[2]
    kind = owner.bl_rna.properties[name].type
    before = getattr(owner, name)
    is_changed = lambda: getattr(owner, name) != before  # noqa: E731
    if kind == "BOOLEAN":
        yield from press(area, button)
        yield from wait_until(is_changed, f"{name} does not switch")
        yield from press(area, button)
        yield from wait_until(lambda: not is_changed(), f"{name} does not switch back")
        return
    if kind in {"INT", "FLOAT"}:
        yield from point_at(area, button)
        yield from press_key("Return")
        yield from type_text(text or f"{before + 1:g}")
        yield from press_key("Return")
    elif kind == "STRING":
        yield from press(area, button)
        yield from press_key("ctrl+a")
        yield from type_text(text or "x")
        yield from press_key("Return")
    else:
        yield from choose_another(area, button, is_changed)
    yield from wait_until(is_changed, f"{name} stays {before!r}")
    look()
    setattr(owner, name, before)
    yield from redrawn()


def choose_another(area: bpy.types.Area, button: Button, is_changed: Callable[[], bool]) -> Step:
    """Choose from a menu or a search list. A key may move within it, or first show the current entry."""
    for keys in (["Down"], ["Down", "Down"], ["Up"]):
        yield from press(area, button)
        yield from press_key(*keys, "Return")
        if is_changed():
            return


# Panels --------------------------------------------------------------------------------------------------------------


def header_height(last_above: Button, number: int) -> float:
    """Where a closed panel's header is: the number-th below the last button of the panel above, from 0."""
    return last_above.y - FIRST_HEADER - HEADER_HEIGHT * number


def toggle_panel(area: bpy.types.Area, y: float) -> Step:
    region = panel_region(area)
    hover(region.x + region.width * 0.4, y)
    yield from handled()
    yield from press_here()
    yield from at_rest(area)


def with_panel_open(area: bpy.types.Area, y: float, work: Callable[[list[Button]], Step]) -> Step:
    """Open the panel whose header is at `y`, do something with the buttons below it, and close it."""
    yield from toggle_panel(area, y)
    buttons = yield from list_buttons(area, top=y - HEADER_HEIGHT / 2)
    yield from work(buttons)
    yield from leave(area)
    yield from toggle_panel(area, y)
