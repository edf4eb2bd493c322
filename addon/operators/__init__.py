"""What the buttons of the panels do."""

from __future__ import annotations

from . import preview

_MODULES = (preview,)


def register() -> None:
    for module in _MODULES:
        module.register()


def unregister() -> None:
    for module in reversed(_MODULES):
        module.unregister()
