"""Render a scene in each mode that makes a picture; the others (`uv`, `depth`, `distance`) are data."""

import bpy
import perfect_bvh_addon
from shared import SCENES, read_arguments

folder, width = read_arguments(480)
perfect_bvh_addon.register()
bpy.ops.wm.open_mainfile(filepath=str(SCENES / "gears.blend"))

scene = bpy.context.scene
scene.render.engine = "PERFECT_BVH"
scene.render.resolution_x, scene.render.resolution_y = width, width * 9 // 16
scene.render.resolution_percentage = 100
for mode in ("preview", "clay", "matcap", "wireframe", "normal", "instance", "material", "cost"):
    scene.perfect_bvh.mode = mode.upper()
    scene.render.filepath = str(folder.resolve() / f"mode_{mode}.png")
    bpy.ops.render.render(write_still=True)
    print(scene.render.filepath)
