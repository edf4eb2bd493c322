"""The panels in the Render and View Layer properties, in the order in which they are shown."""

from __future__ import annotations

import bpy

from ..settings.scene_settings import ENGINE_NAME
from . import bench, borrowed, not_shown, overlay, rays, render, reports

CLASSES = (
    *render.CLASSES,
    *not_shown.CLASSES,
    *rays.CLASSES,
    *overlay.CLASSES,
    *reports.CLASSES,
    *bench.CLASSES,
    *render.LAST_CLASSES,
    *borrowed.CLASSES,
)


def register() -> None:
    for panel in (*not_shown.LISTS, *CLASSES):
        bpy.utils.register_class(panel)
    for panel in borrowed.shared_panels():
        panel.COMPAT_ENGINES.add(ENGINE_NAME)


def unregister() -> None:
    for panel in borrowed.shared_panels():
        panel.COMPAT_ENGINES.discard(ENGINE_NAME)
    for panel in reversed((*not_shown.LISTS, *CLASSES)):
        bpy.utils.unregister_class(panel)
