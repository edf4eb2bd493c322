"""The panels in the properties and in the sidebar of 3D viewports, in the order in which they are shown."""

from __future__ import annotations

import bpy

from ..settings.scene_settings import ENGINE_NAME
from . import (
    bench,
    borrowed,
    camera,
    hair,
    light,
    light_paths,
    material,
    motion_blur,
    not_shown,
    overlay,
    render,
    reports,
    sampling,
    scan,
    shading,
    trees,
    updates,
    view_layer,
    view_menu,
    visibility,
    walk_ray,
    world,
)

CLASSES = (
    *render.CLASSES,
    *not_shown.CLASSES,
    *sampling.CLASSES,
    *light_paths.CLASSES,
    *hair.CLASSES,
    *motion_blur.RENDER_CLASSES,
    *render.LAST_CLASSES,
    *overlay.CLASSES,
    *reports.CLASSES,
    *view_layer.CLASSES,
    *visibility.CLASSES,
    *motion_blur.OBJECT_CLASSES,
    *camera.CLASSES,
    *light.CLASSES,
    *material.CLASSES,
    *world.CLASSES,
    *shading.CLASSES,
    *scan.CLASSES,
    *bench.CLASSES,
    *updates.CLASSES,
    *trees.CLASSES,
    *walk_ray.CLASSES,
)
LISTS = (*not_shown.LISTS, *updates.LISTS)


def register() -> None:
    for panel in (*LISTS, *CLASSES):
        bpy.utils.register_class(panel)
    for panel in borrowed.shared_panels():
        panel.COMPAT_ENGINES.add(ENGINE_NAME)
    for module in (view_menu, visibility):
        module.register()


def unregister() -> None:
    for module in (visibility, view_menu):
        module.unregister()
    for panel in borrowed.shared_panels():
        panel.COMPAT_ENGINES.discard(ENGINE_NAME)
    for panel in reversed((*LISTS, *CLASSES)):
        bpy.utils.unregister_class(panel)
