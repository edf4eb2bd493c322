"""A row of what is not shown, chosen: the objects that it is about are selected."""

from __future__ import annotations

from typing import Any, ClassVar

import bpy

from ..sync.not_shown import SELECTABLE
from .selecting import can_select, select_only


class PERFECT_BVH_OT_select_not_shown(bpy.types.Operator):
    """Finds objects by what is not shown of them."""

    bl_idname = "perfect_bvh.select_not_shown"
    bl_label = "Select Objects"
    bl_description = "Select the objects that this is about"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    kind: bpy.props.EnumProperty(
        name="Kind",
        description="What the number is of",
        items=[(kind, kind.title(), f"Every object that {what}") for kind, what in SELECTABLE.items()],
        options={"HIDDEN"},
    )
    session_uid: bpy.props.IntProperty(
        name="Session UID", description="Number that Blender gave it", options={"HIDDEN"}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_select(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        return select_only(self, context, self._is_meant, SELECTABLE[self.kind])

    def _is_meant(self, obj: Any) -> bool:
        uid = self.session_uid
        if self.kind in {"object", "scan", "shape"}:
            return bool(obj.session_uid == uid)
        if self.kind == "light":
            return obj.session_uid == uid or (obj.type == "LIGHT" and obj.data.session_uid == uid)
        if self.kind == "library":
            return any(block is not None and _is_of(block.library, uid) for block in (obj, obj.data))
        return any(_is_of(slot.material, uid) for slot in obj.material_slots)


def _is_of(block: Any, session_uid: int) -> bool:
    return block is not None and block.session_uid == session_uid


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_OT_select_not_shown)


def unregister() -> None:
    bpy.utils.unregister_class(PERFECT_BVH_OT_select_not_shown)
