"""A row of What Was Updated, clicked: its objects are selected, or what shows them."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ..statistics.update_list import PERFECT_BVH_PG_updates, instancers_of, row_of, rows_of
from ..statistics.updates import UpdateRow
from .selecting import can_select, select_visible


class PERFECT_BVH_OT_select_updated(bpy.types.Operator):
    """Finds the objects of the active row, and says beside it why they could not be selected."""

    bl_idname = "perfect_bvh.select_updated"
    bl_label = "Select Objects"
    bl_description = "Select the objects of the active row of What Was Updated"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_select(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        rows = rows_of(context.scene)
        row = None if rows is None else row_of(rows, rows.active)
        if rows is None or row is None:
            self.report({"WARNING"}, "No row of What Was Updated is chosen")
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
    # What is shown as instances alone is hidden itself, or in no collection of the view layer.
    visible = [obj for obj in found if obj.visible_get(view_layer=layer)]
    if not visible:
        instancers = instancers_of(rows, row)
        visible = [obj for obj in objects if obj.session_uid in instancers and obj.visible_get(view_layer=layer)]
    if visible:
        return "" if select_visible(layer, visible) else f"The Outliner disables selection of {row.title}"
    return f"{row.title}: hidden here" if found else f"{row.title}: not in this view layer"


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_OT_select_updated)


def unregister() -> None:
    bpy.utils.unregister_class(PERFECT_BVH_OT_select_updated)
