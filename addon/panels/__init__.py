"""The panels in the properties and in the sidebar of 3D viewports, in the order in which they are shown.

render     render properties: mode, sampling, light paths, curves, motion blur
objects    cameras, lights, materials, worlds, objects
output     passes of a view layer, scans, labels, bakes
viewports  overlays, shading, rendering a view, the walk of a ray
reports    statistics, updates, comparison, parts of the scene that are not shown, the bench
common     their common parts
"""

from __future__ import annotations

import bpy

from ..settings.scene_settings import ENGINE_NAME
from . import objects, output, render, reports, viewports

CLASSES = (
    *render.RENDER_CLASSES,
    *reports.NOT_SHOWN_CLASSES,
    *render.SAMPLING_CLASSES,
    *render.LIGHT_PATHS_CLASSES,
    *render.HAIR_CLASSES,
    *render.MOTION_BLUR_CLASSES,
    *render.LAST_CLASSES,
    *viewports.OVERLAY_CLASSES,
    *reports.REPORTS_CLASSES,
    *output.VIEW_LAYER_CLASSES,
    *objects.VISIBILITY_CLASSES,
    *objects.OBJECT_CLASSES,
    *objects.CAMERA_CLASSES,
    *objects.LIGHT_CLASSES,
    *objects.MATERIAL_CLASSES,
    *objects.WORLD_CLASSES,
    *viewports.SHADING_CLASSES,
    *output.SCAN_CLASSES,
    *output.LABEL_CLASSES,
    *output.BAKE_CLASSES,
    *viewports.RENDER_VIEW_CLASSES,
    *reports.UPDATES_CLASSES,
    *viewports.DISPLAY_CLASSES,
    *reports.COMPARE_CLASSES,
    *viewports.WALK_RAY_CLASSES,
    *reports.BENCH_CLASSES,
)
LISTS = (*reports.NOT_SHOWN_LISTS, *reports.UPDATES_LISTS)


def register() -> None:
    for panel in (*LISTS, *CLASSES):
        bpy.utils.register_class(panel)
    for panel in objects.shared_panels():
        panel.COMPAT_ENGINES.add(ENGINE_NAME)
    for module in (viewports, objects):
        module.register()


def unregister() -> None:
    for module in (objects, viewports):
        module.unregister()
    for panel in objects.shared_panels():
        panel.COMPAT_ENGINES.discard(ENGINE_NAME)
    for panel in reversed((*LISTS, *CLASSES)):
        bpy.utils.unregister_class(panel)
