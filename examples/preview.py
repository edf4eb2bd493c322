"""Render a scene by the Perfect BVH engine, without a GPU or a display."""

import bpy
import perfect_bvh_addon
from shared import SCENES, read_arguments

folder, width = read_arguments()
perfect_bvh_addon.register()
bpy.ops.wm.open_mainfile(filepath=str(SCENES / "courtyard.blend"))

scene = bpy.context.scene
scene.render.engine = "PERFECT_BVH"
scene.perfect_bvh.samples = 16
scene.render.resolution_x, scene.render.resolution_y = width, width * 9 // 16
scene.render.resolution_percentage = 100
scene.render.filepath = str(folder.resolve() / "preview.png")
bpy.ops.render.render(write_still=True)
print(scene.render.filepath)
