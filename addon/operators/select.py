"""Buttons that select objects: those that are not shown, and those that an update changed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import bpy

from ..statistics.update_list import PERFECT_BVH_PG_updates, instancers_of, row_of, rows_of
from ..statistics.updates import UpdateRow
from ..sync.not_shown import SELECTABLE

# Selects the objects of a row of a panel's list.


def can_select(operator: Any, context: bpy.types.Context) -> bool:
    """Whether an operator's `poll` succeeds; it then says why not."""
    if context.mode != "OBJECT":
        operator.poll_message_set("Objects can be selected in Object Mode only")
        return False
    return True


def select_only(
    operator: bpy.types.Operator, context: bpy.types.Context, is_meant: Callable[[Any], bool], what: str
) -> set[str]:
    """Select only these visible objects; returns the operator's result. what: their description."""
    layer = context.view_layer
    found = [obj for obj in layer.objects if is_meant(obj) and obj.visible_get()]
    if not found:
        operator.report({"WARNING"}, f"No object that is visible here {what}")
        return {"CANCELLED"}
    if not select_visible(layer, found):
        operator.report({"WARNING"}, f"The Outliner disables selection of every object that {what}")
        return {"CANCELLED"}
    return {"FINISHED"}


def select_visible(layer: bpy.types.ViewLayer, objects: Sequence[bpy.types.Object]) -> bool:
    """Select these of a view layer and no others, the first one as the active one; False if none can be selected."""
    for obj in objects:
        obj.select_set(True)
    selected = [obj for obj in objects if obj.select_get()]
    if not selected:
        return False
    wanted = {obj.session_uid for obj in selected}
    for obj in layer.objects:
        if obj.select_get() and obj.session_uid not in wanted:
            obj.select_set(False)
    layer.objects.active = selected[0]
    return True


# Select not shown ----------------------------------------------------------------------------------------------------
# Selects the objects of the chosen row of the list Not Shown.


class PERFECT_BVH_OT_select_not_shown(bpy.types.Operator):
    """Selects the objects of a row of the list Not Shown."""

    bl_idname = "perfect_bvh.select_not_shown"
    bl_label = "Select Objects"
    bl_description = "Select the objects of this row"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    kind: bpy.props.EnumProperty(
        name="Kind",
        description="Kind of data of the number",
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


# Select updated ------------------------------------------------------------------------------------------------------
# A row of Scene Updates, clicked: its objects are selected, or what shows them.


class PERFECT_BVH_OT_select_updated(bpy.types.Operator):
    """Selects the objects of the active row, and shows next to it why they could not be selected."""

    bl_idname = "perfect_bvh.select_updated"
    bl_label = "Select Objects"
    bl_description = "Select the objects of the active row of Scene Updates"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_select(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        rows = rows_of(context.scene)
        row = None if rows is None else row_of(rows, rows.active)
        if rows is None or row is None:
            self.report({"WARNING"}, "Choose a row of Scene Updates first")
            return {"CANCELLED"}
        rows.note = _select(context.view_layer, rows, row)
        if rows.note:
            self.report({"WARNING"}, rows.note)
            return {"CANCELLED"}
        return {"FINISHED"}


def _select(layer: bpy.types.ViewLayer, rows: PERFECT_BVH_PG_updates, row: UpdateRow) -> str:
    """Why that cannot be done, as a sentence; "" if it was done."""
    objects = list(layer.objects)
    uids = set(row.uids.tolist())
    found = [obj for obj in objects if obj.session_uid in uids]
    # Objects that are only shown as instances are hidden themselves, or in no collection of the view layer.
    visible = [obj for obj in found if obj.visible_get(view_layer=layer)]
    if not visible:
        instancers = instancers_of(rows, row)
        visible = [obj for obj in objects if obj.session_uid in instancers and obj.visible_get(view_layer=layer)]
    if visible:
        return "" if select_visible(layer, visible) else f"The Outliner disables selection of {row.title}"
    return f"{row.title}: hidden here" if found else f"{row.title}: not in this view layer"


CLASSES = (PERFECT_BVH_OT_select_not_shown, PERFECT_BVH_OT_select_updated)
