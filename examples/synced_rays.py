"""Cast a million rays into a Blender scene, name what they hit, and follow a change."""

import bpy
import numpy as np
import perfect_bvh_addon
from shared import SCENES, id_colors, read_arguments, save_png

folder, width = read_arguments(1000)
bpy.ops.wm.open_mainfile(filepath=str(SCENES / "courtyard.blend"))
sync = perfect_bvh_addon.SceneSync()
sync.update(bpy.context.evaluated_depsgraph_get(), expected_rays=width * width)

x, y = np.meshgrid(np.linspace(-10, 10, width), np.linspace(10, -10, width))
origins = np.stack([x, y, np.full_like(x, 100.0)], axis=-1)
hits = sync.scene.cast_rays(origins, [0.0, 0.0, -1.0])  # straight down

heights = np.where(hits.is_hit, 100.0 - hits.t_hit, 0.0)
found = sync.describe(hits.instance_ids)  # of each ray the object's name and more
_, ids = np.unique(found.names.astype(str), return_inverse=True)
colors = id_colors(np.where(hits.is_hit, ids.reshape(hits.is_hit.shape), -1))
save_png(folder / "synced_rays.png", colors * (0.4 + 0.6 * heights / heights.max())[..., None])

row, column = np.unravel_index(np.argmax(heights), heights.shape)
name = found.names[row, column]
print(f"{name} is the highest, at {heights[row, column]:.2f} m")

bpy.data.objects[name].location.z += 1.0
report = sync.update(bpy.context.evaluated_depsgraph_get())  # without it queries raise StaleSceneError
hits = sync.scene.cast_rays(origins, [0.0, 0.0, -1.0], out=hits)  # over the same memory
print(f"{report.moved_count} instances were moved; now the highest is at {100.0 - hits.t_hit.min():.2f} m")
