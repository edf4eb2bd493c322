"""The add-on's panels: its sub-panels are found by their order below the main one, and worked in."""

from __future__ import annotations

from collections.abc import Callable

from addon_state import settings
from buttons import Button, change, header_height, leave, list_buttons, with_panel_open
from driver import OUTPUT, Step, check, screenshot
from places import area_of

# In the order of the panel, while nothing was rendered yet.
SUB_PANELS = ("Sampling", "Film", "Performance", "Rays", "Bench")

# As long as the window keeps its size, the panel's last button stays where it is.
_last_button: dict[str, Button] = {}


def main_buttons() -> Step:
    """Returns those of the panel itself, while all below it are closed."""
    found = yield from list_buttons(area_of("PROPERTIES"))
    names = [button.what.removeprefix("bpy.ops.").partition("(")[0] for button in found]
    return dict(zip(names, found, strict=True))


def header_of(number: int) -> Step:
    """Returns where the header of the number-th sub-panel is, all being closed."""
    check(settings().mode == "PREVIEW", "panels are where they are in the mode Preview only")
    if "samples" not in _last_button:
        buttons = yield from main_buttons()
        _last_button["samples"] = buttons["perfect_bvh.samples"]
    return header_height(_last_button["samples"], number)


def open_sub_panel(title: str, work: Callable[[list[Button]], Step]) -> Step:
    """Do something with the buttons of a sub-panel. The mode must be Preview, which has the fewest settings."""
    y = yield from header_of(SUB_PANELS.index(title))

    def look_and_work(buttons: list[Button]) -> Step:
        name = f"panel_{title.lower().replace(' ', '_')}"
        if not (OUTPUT / f"{name}.png").exists():
            yield from leave(area_of("PROPERTIES"))
            screenshot(name)
        yield from work(buttons)

    yield from with_panel_open(area_of("PROPERTIES"), y, look_and_work)


def change_all(owner: object, names: dict[str, str | None]) -> Callable[[list[Button]], Step]:
    """Change these properties, by what is typed into each."""

    def work(buttons: list[Button]) -> Step:
        found = {button.what.rpartition(".")[2]: button for button in buttons}
        for name, text in names.items():
            check(name in found, f"no button of {name} among {list(found)}")
            yield from change(area_of("PROPERTIES"), found[name], owner, text)

    return work
