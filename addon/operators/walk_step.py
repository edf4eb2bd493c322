"""Steps of a ray that is walked: what keys stand for, as buttons."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import bpy

from ..settings.editors import redraw_viewports
from .ticking import Checked

if TYPE_CHECKING:
    from ..view3d.walk.shown_walk import ShownWalk


class PERFECT_BVH_OT_walk_step(Checked, bpy.types.Operator):
    """The buttons that keys stand for."""

    bl_idname = "perfect_bvh.walk_step"
    bl_label = "Step"
    bl_description = "Go to another step of the ray that is walked"
    bl_options: ClassVar = {"INTERNAL"}

    to: bpy.props.EnumProperty(
        name="To",
        description="Which step of the ray is shown next, or whether the steps play",
        items=[
            ("FIRST", "First", "Go to the first step of the ray"),
            ("PREVIOUS", "Previous", "Go back to the step before"),
            ("PREVIOUS_BOX", "Previous Box", "Go back to the box or triangle before"),
            ("PLAY", "Play", "Play the steps one after the other, or pause"),
            ("NEXT_BOX", "Next Box", "Go on to the next box or triangle, and see what happens to it"),
            ("NEXT", "Next", "Go on to the next step: a node with its boxes, or a leaf with its triangles"),
            ("LAST", "Last", "Go to the last step, with the hit"),
            ("OFF", "End", "Show the scene again without the ray"),
        ],
        options={"SKIP_SAVE"},
    )

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        return cls.bl_rna.properties["to"].enum_items[properties.to].description

    @classmethod
    def _find_complaint(cls, context: bpy.types.Context) -> str | None:
        from ..view3d.walk import walk_view

        return "No ray is walked" if walk_view.shown() is None else None

    def execute(self, context: bpy.types.Context) -> set[str]:
        go(self.to)
        return {"FINISHED"}


def go(to: str) -> None:
    """To another step of the walk that is shown: see `PERFECT_BVH_OT_walk_step`."""
    from ..view3d.walk import walk_view

    walk = walk_view.shown()
    if walk is None:
        return
    if to == "OFF":
        walk_view.hide()
        return
    if to == "PLAY":
        walk.play_or_pause()
    else:
        walk.is_playing = False
        _move(walk, to)
    redraw_viewports()


def _move(walk: ShownWalk, to: str) -> None:
    if to == "NEXT":
        walk.go_to_next_step()
    elif to == "NEXT_BOX":
        walk.go_to_next_box()
    elif to == "PREVIOUS_BOX":
        walk.go_to_previous_box()
    else:
        walk.go({"FIRST": 0, "PREVIOUS": walk.index - 1, "LAST": len(walk.steps) - 1}[to])


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_OT_walk_step)


def unregister() -> None:
    bpy.utils.unregister_class(PERFECT_BVH_OT_walk_step)
