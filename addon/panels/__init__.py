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
    render.PERFECT_BVH_PT_render,
    reports.PERFECT_BVH_PT_not_shown,
    render.PERFECT_BVH_PT_sampling,
    render.PERFECT_BVH_PT_sampling_viewport,
    render.PERFECT_BVH_PT_sampling_render,
    render.PERFECT_BVH_PT_sampling_advanced,
    render.PERFECT_BVH_PT_light_paths,
    render.PERFECT_BVH_PT_light_paths_bounces,
    render.PERFECT_BVH_PT_light_paths_clamping,
    render.PERFECT_BVH_PT_light_paths_caustics,
    render.PERFECT_BVH_PT_hair,
    render.PERFECT_BVH_PT_motion_blur,
    render.PERFECT_BVH_PT_motion_blur_curve,
    render.PERFECT_BVH_PT_film,
    render.PERFECT_BVH_PT_simplify,
    render.PERFECT_BVH_PT_simplify_viewport,
    render.PERFECT_BVH_PT_simplify_render,
    render.PERFECT_BVH_PT_performance,
    render.PERFECT_BVH_PT_performance_viewport,
    viewports.PERFECT_BVH_PT_overlay,
    reports.PERFECT_BVH_PT_statistics,
    output.PERFECT_BVH_PT_passes,
    output.PERFECT_BVH_PT_filter,
    *(() if output.HAS_OVERRIDE else (output.PERFECT_BVH_PT_override,)),
    objects.PERFECT_BVH_PT_ray_visibility,
    objects.PERFECT_BVH_PT_object_motion_blur,
    objects.PERFECT_BVH_PT_panorama,
    objects.PERFECT_BVH_PT_light_beam,
    objects.PERFECT_BVH_PT_light_settings,
    objects.PERFECT_BVH_PT_light_nodes,
    objects.PERFECT_BVH_PT_material_surface,
    objects.PERFECT_BVH_PT_material_settings,
    objects.PERFECT_BVH_PT_world_preview,
    objects.PERFECT_BVH_PT_world_surface,
    viewports.PERFECT_BVH_PT_shading_lighting,
    viewports.PERFECT_BVH_PT_shading_render_pass,
    output.PERFECT_BVH_PT_scan,
    output.PERFECT_BVH_PT_label_images,
    output.PERFECT_BVH_PT_bake_rays,
    viewports.PERFECT_BVH_PT_render_view,
    reports.PERFECT_BVH_PT_updates,
    viewports.PERFECT_BVH_PT_display,
    reports.PERFECT_BVH_PT_compare,
    viewports.PERFECT_BVH_PT_walk_ray,
    reports.PERFECT_BVH_PT_bench,
)
LISTS = (reports.PERFECT_BVH_UL_not_shown, reports.PERFECT_BVH_UL_updates)


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
