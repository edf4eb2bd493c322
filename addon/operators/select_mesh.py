"""A row of the Plan, clicked: the objects that show the mesh are selected."""

from __future__ import annotations

from typing import Any, ClassVar

import bpy

from .selecting import can_select, select_only

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
        return can_select(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        return select_only(self, context, self._shows, "shows this mesh")

    def _shows(self, obj: Any) -> bool:
        if self.source == "mesh":
            return obj.data is not None and obj.data.session_uid == self.session_uid
        return obj.session_uid == self.session_uid


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_OT_select_mesh)


def unregister() -> None:
    bpy.utils.unregister_class(PERFECT_BVH_OT_select_mesh)
