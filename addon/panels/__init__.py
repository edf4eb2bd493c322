"""The panels in the properties and in the sidebar of 3D viewports, in the order in which they are shown."""

from __future__ import annotations

import bpy

from ..settings.scene_settings import ENGINE_NAME
from . import bench, borrowed, not_shown, overlay, render, reports, scan, trees

CLASSES = (
    *render.CLASSES,
    *not_shown.CLASSES,
    *overlay.CLASSES,
    *reports.CLASSES,
    *render.LAST_CLASSES,
    *borrowed.CLASSES,
    *trees.CLASSES,
    *scan.CLASSES,
    *bench.CLASSES,
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
