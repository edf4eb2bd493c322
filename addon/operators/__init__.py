"""What the buttons of the panels do."""

from __future__ import annotations

from . import (
    bench,
    color_points,
    compare,
    preview,
    scan,
    select_not_shown,
    select_updated,
    status_bar,
    walk_ray,
    walk_step,
)

_MODULES = (
    status_bar,
    preview,
    scan,
    color_points,
    bench,
    compare,
    select_not_shown,
    select_updated,
    walk_ray,
    walk_step,
)


def register() -> None:
    for module in _MODULES:
        module.register()


def unregister() -> None:
    for module in reversed(_MODULES):
        module.unregister()
