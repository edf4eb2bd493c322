"""Render gears with motion blur, and say how much of the view moves while the shutter is open."""

import bpy
import numpy as np
import perfect_bvh_addon
from shared import SCENES, read_arguments

folder, width = read_arguments()
perfect_bvh_addon.register()
bpy.ops.wm.open_mainfile(filepath=str(SCENES / "gears.blend"))

scene = bpy.context.scene
scene.render.engine = "PERFECT_BVH"
scene.render.use_motion_blur = True
scene.render.motion_blur_shutter = 0.5  # frames
scene.render.resolution_x, scene.render.resolution_y = width, width * 9 // 16
scene.render.resolution_percentage = 100
scene.render.filepath = str(folder.resolve() / "motion_blur.png")
bpy.ops.render.render(write_still=True)
print(scene.render.filepath)

sync = perfect_bvh_addon.SceneSync()
report = sync.update(bpy.context.evaluated_depsgraph_get(), shutter=(-0.25, 0.25))  # these become times 0 and 1
rays = sync.camera.pixel_rays(sync.size)
early, late = (sync.scene.cast_rays(*rays, times=time, fields=("t_hit",)) for time in (0.0, 1.0))
print(f"{report.motion_count} instances and meshes move, over {np.mean(early.t_hit != late.t_hit):.1%} of the view")
