"""What the buttons of the panels do."""

from __future__ import annotations

from . import failure_case, preview, scan

_MODULES = (preview, scan, failure_case)


def register() -> None:
    for module in _MODULES:
        module.register()


def unregister() -> None:
    for module in reversed(_MODULES):
        module.unregister()
