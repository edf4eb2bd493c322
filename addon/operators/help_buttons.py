"""Small buttons that help: the question marks of panels, and one that copies a command."""

from __future__ import annotations

from typing import ClassVar

import bpy


class PERFECT_BVH_OT_open_manual(bpy.types.Operator):
    """Opens a page of the manual. Blender's own button for that has a tooltip that speaks of a website."""

    bl_idname = "perfect_bvh.open_manual"
    bl_label = "Open the Manual"
    bl_description = "Open this panel's page of the manual in the browser. It is on this computer"
    bl_options: ClassVar = {"INTERNAL"}

    url: bpy.props.StringProperty(
        name="Address", description="The page, and the heading on it", options={"HIDDEN", "SKIP_SAVE"}
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        return bpy.ops.wm.url_open(url=self.url)


class PERFECT_BVH_OT_copy_command(bpy.types.Operator):
    """Copies a command that a message names."""

    bl_idname = "perfect_bvh.copy_command"
    bl_label = "Copy Command"
    bl_description = "Copy this command to the clipboard, to be pasted into a terminal"
    bl_options: ClassVar = {"INTERNAL"}

    command: bpy.props.StringProperty(
        name="Command", description="The line to paste into a terminal", options={"HIDDEN", "SKIP_SAVE"}
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        context.window_manager.clipboard = self.command
        self.report({"INFO"}, f"Copied: {self.command}")
        return {"FINISHED"}


CLASSES = (PERFECT_BVH_OT_open_manual, PERFECT_BVH_OT_copy_command)
