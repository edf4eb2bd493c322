"""Selecting what a row of a panel's list is about."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import bpy


def can_select(operator: Any, context: bpy.types.Context) -> bool:
    """For an operator's `poll`, which then says why not."""
    if context.mode != "OBJECT":
        operator.poll_message_set("Objects can be selected in Object Mode only")
        return False
    return True


def select_only(
    operator: bpy.types.Operator, context: bpy.types.Context, is_meant: Callable[[Any], bool], what: str
) -> set[str]:
    """Select the visible objects that are meant and no others; what an operator returns. what: they do, in words."""
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
