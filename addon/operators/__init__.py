"""What the buttons of the panels do."""

from __future__ import annotations

from . import failure_case, preview, scan, select_mesh

_MODULES = (preview, scan, failure_case, select_mesh)


def register() -> None:
    for module in _MODULES:
        module.register()


def unregister() -> None:
    for module in reversed(_MODULES):
        module.unregister()
