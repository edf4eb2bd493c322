"""The add-on's panels: those of the Render properties by their order, those of its sidebar tab; worked in by mouse."""

from __future__ import annotations

from collections.abc import Callable

from addon_state import settings
from buttons import Button, change, leave, list_buttons, toggle_panel, with_panel_open
from driver import OUTPUT, Step, at_rest, check, redrawn, screenshot
from places import area_of, main_area, region_of

# In the order in which they are shown, while nothing was rendered yet.
PANELS = ("Sampling", "Light Paths", "Curves", "Motion Blur", "Film", "Simplify", "Performance")
# In pixels, at the resolution scale that a new user has: below the last button above them, and each below the other.
FIRST_PANEL, PANEL_HEIGHT = 35, 28

# As long as the window keeps its size, the last button above the panels stays where it is.
_last_button: dict[str, Button] = {}


def main_buttons() -> Step:
    """Returns those above the panels, while all of these are closed."""
    found = yield from list_buttons(area_of("PROPERTIES"))
    names = [button.what.removeprefix("bpy.ops.").partition("(")[0] for button in found]
    return dict(zip(names, found, strict=True))


def header_of(number: int) -> Step:
    """Returns where the header of the number-th panel is, all being closed."""
    check(settings().mode == "PREVIEW", "panels are where they are in the mode Lit only")
    if "last" not in _last_button:
        buttons = yield from main_buttons()
        _last_button["last"] = buttons["perfect_bvh.preview_percentage"]
    return _last_button["last"].y - FIRST_PANEL - PANEL_HEIGHT * number


def close_the_open_one() -> Step:
    """Sampling, which a new user finds open."""
    area = area_of("PROPERTIES")
    buttons = yield from list_buttons(area)
    _last_button["last"] = next(button for button in buttons if "preview_percentage" in button.what)
    yield from leave(area)
    yield from toggle_panel(area, (yield from header_of(0)))


def open_panel(title: str, work: Callable[[list[Button]], Step]) -> Step:
    """Do something with the buttons of a panel. The mode must be Lit, which has the fewest settings."""
    y = yield from header_of(PANELS.index(title))

    def look_and_work(buttons: list[Button]) -> Step:
        yield from leave(area_of("PROPERTIES"))
        photograph(title)
        yield from work(buttons)

    yield from with_panel_open(area_of("PROPERTIES"), y, look_and_work)


def open_sidebar(title: str, work: Callable[[list[Button]], Step]) -> Step:
    """Do something with the buttons of the add-on's tab in the sidebar. title: of the panel that is of interest."""
    area = main_area()
    kind, area.type = area.type, "VIEW_3D"
    yield from redrawn()
    area.spaces.active.show_region_ui = True
    yield from redrawn()
    region_of(area, "UI").active_panel_category = "Perfect BVH"
    area.tag_redraw()
    yield from at_rest(area)
    photograph(title)
    yield from work((yield from list_buttons(area)))
    yield from leave(area)
    area.spaces.active.show_region_ui = False
    area.type = kind
    yield from redrawn()


def photograph(title: str) -> None:
    """Once."""
    name = f"panel_{title.lower().replace(' ', '_')}"
    if not (OUTPUT / f"{name}.png").exists():
        screenshot(name)


def change_all(owner: object, names: dict[str, str | None], kind: str = "PROPERTIES") -> Callable[[list[Button]], Step]:
    """Change these properties by typing the given text into each. kind: of the area that shows them."""

    def work(buttons: list[Button]) -> Step:
        found = {button.what.rpartition(".")[2]: button for button in buttons}
        for name, text in names.items():
            check(name in found, f"no button of {name} among {list(found)}")
            yield from change(area_of(kind), found[name], owner, text)

    return work
