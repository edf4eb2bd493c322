"""Blender's own panels that stay of use with this engine."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

# Panels that Blender offers every engine, without those of features that this engine does not have; Simplify it shows
# in a place of its own.
UNSUPPORTED_PANELS = ("freestyle", "grease_pencil", "gpencil", "render_pt_simplify")
# Those of which a fuller one is borrowed, and their copies in the Shader Editor.
POORER_PANELS = ("DATA_PT_light", "NODE_DATA_PT_light")
# Panels of Blender's own engines whose settings this engine honours, or that a user wants to change all the same, so
# that materials, lights and the world can be worked on without going to another engine and back.
BORROWED_PANELS = (
    "DATA_PT_EEVEE_light",
    "DATA_PT_camera_dof",
    "DATA_PT_camera_dof_aperture",
    "EEVEE_MATERIAL_PT_context_material",
    "MATERIAL_PT_preview",
    "VIEWLAYER_PT_layer_passes",
    "VIEWLAYER_PT_override",
)


def shared_panels() -> Iterator[type[bpy.types.Panel]]:
    """The panels of Blender that are shown with this engine."""
    for panel in _all_panels(bpy.types.Panel):
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if not isinstance(engines, set):
            continue
        name = panel.__name__
        is_out = name in POORER_PANELS or any(word in name.lower() for word in UNSUPPORTED_PANELS)
        if name in BORROWED_PANELS or ("BLENDER_RENDER" in engines and not is_out):
            yield panel


def _all_panels(base: type) -> Iterator[type[bpy.types.Panel]]:
    for panel in base.__subclasses__():
        yield panel
        yield from _all_panels(panel)
