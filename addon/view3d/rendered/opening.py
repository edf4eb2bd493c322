"""Screens whose 3D viewports are Rendered when their file is opened.

Blender opens every viewport in Solid shading, for any file, as renders may be heavy. This engine shows a first image
at once and traces the rest in the background, so a screen may ask for it. The setting is kept on the screen: opening a
file without its interface (*Load UI*) keeps the previous screens, which do not change.
"""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

from ...settings.scene_settings import ENGINE_NAME

PROPERTY = "perfect_bvh_open_rendered"


def show_rendered(scene: bpy.types.Scene) -> None:
    """Rendered shading in the 3D viewports of all screens that ask for it, if the scene has this engine."""
    if scene.render.engine != ENGINE_NAME:
        return
    for screen in bpy.data.screens:
        if getattr(screen, PROPERTY):
            for area in screen.areas:
                if area.type == "VIEW_3D":
                    area.spaces.active.shading.type = "RENDERED"


@persistent
def _on_load(*_: object) -> None:
    if not bpy.app.background:
        show_rendered(bpy.context.scene)


def register() -> None:
    setattr(
        bpy.types.Screen,
        PROPERTY,
        bpy.props.BoolProperty(
            name="Open Rendered",
            description=(
                "Show the 3D viewports of this screen in Rendered shading when the file is opened, with Perfect BVH as "
                "render engine; Blender opens them in Solid"
            ),
            default=False,
        ),
    )
    bpy.app.handlers.load_post.append(_on_load)


def unregister() -> None:
    if _on_load in bpy.app.handlers.load_post:  # somebody may have emptied the list
        bpy.app.handlers.load_post.remove(_on_load)
    delattr(bpy.types.Screen, PROPERTY)
