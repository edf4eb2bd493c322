"""The Add Failure Case button: a scene on which a usual method fails, to look at and to try settings on."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ..failure_cases import CASES, find_case
from ..failure_scenes import add_failure_scene
from ..settings.scene_settings import ENGINE_NAME
from ..view3d.awaited_view import find_view

CASE_ITEMS = [(case.name.upper(), case.title, case.breaks.removesuffix("."), i) for i, case in enumerate(CASES)]


class PERFECT_BVH_OT_add_failure_case(bpy.types.Operator):
    """Makes the case as a scene of its own and shows it; the scenes that there are stay as they are."""

    bl_idname = "perfect_bvh.add_failure_case"
    bl_label = "Add Failure Case"
    bl_description = "Make a scene on which a usual method fails, set to show what each pixel's ray costs"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    case: bpy.props.EnumProperty(name="Case", description="The scene to make", items=CASE_ITEMS)

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = add_failure_scene(find_case(self.case.lower()))
        scene.render.engine = ENGINE_NAME
        scene.perfect_bvh.mode = "COST"
        if context.window is not None:
            context.window.scene = scene
            found = find_view(context)
            if found is not None:
                found[0].region_3d.view_perspective = "CAMERA"  # from elsewhere little is seen of it
        self.report({"INFO"}, f"Made the scene {scene.name!r}; the text of that name says what to look at")
        return {"FINISHED"}


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_OT_add_failure_case)


def unregister() -> None:
    bpy.utils.unregister_class(PERFECT_BVH_OT_add_failure_case)
