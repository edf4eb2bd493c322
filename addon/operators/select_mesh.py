"""A row of the Plan, clicked: the objects that show the mesh are selected."""

from __future__ import annotations

from typing import Any, ClassVar

import bpy

SOURCES = (
    ("mesh", "Mesh", "Every object that has this mesh"),
    ("object", "Object", "The object whose modifiers make the mesh"),
    ("made", "Made", "The object whose geometry nodes or instances make the mesh"),
)


class PERFECT_BVH_OT_select_mesh(bpy.types.Operator):
    """Finds objects by what a mesh's key says that it comes from."""

    bl_idname = "perfect_bvh.select_mesh"
    bl_label = "Select Objects"
    bl_description = "Select the objects that show this mesh"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    source: bpy.props.EnumProperty(
        name="Source", description="What the mesh comes from", items=SOURCES, options={"HIDDEN"}
    )
    session_uid: bpy.props.IntProperty(
        name="Session UID", description="Number that Blender gave the mesh or the object", options={"HIDDEN"}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Objects can be selected in Object Mode only")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        layer = context.view_layer
        found = [obj for obj in layer.objects if self._shows(obj) and obj.visible_get()]
        if not found:
            self.report({"WARNING"}, "No object that is visible here shows this mesh")
            return {"CANCELLED"}
        for obj in found:
            obj.select_set(True)
        selected = [obj for obj in found if obj.select_get()]
        if not selected:
            self.report({"WARNING"}, "The Outliner disables selection of the objects that show this mesh")
            return {"CANCELLED"}
        for obj in layer.objects:
            obj.select_set(obj in selected)
        layer.objects.active = selected[0]
        return {"FINISHED"}

    def _shows(self, obj: Any) -> bool:
        if self.source == "mesh":
            return obj.data is not None and obj.data.session_uid == self.session_uid
        return obj.session_uid == self.session_uid


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_OT_select_mesh)


def unregister() -> None:
    bpy.utils.unregister_class(PERFECT_BVH_OT_select_mesh)
