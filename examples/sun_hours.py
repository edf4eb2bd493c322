"""Count the hours of sun on the ground of a courtyard in one day."""

import bpy
import numpy as np
import perfect_bvh_addon
from shared import SCENES, read_arguments, save_png, to_colors

folder, width = read_arguments()
bpy.ops.wm.open_mainfile(filepath=str(SCENES / "courtyard.blend"))
sync = perfect_bvh_addon.SceneSync()
sync.update(bpy.context.evaluated_depsgraph_get())

x, y = np.meshgrid(np.linspace(-10, 10, width), np.linspace(10, -10, width))
points = np.stack([x, y, np.full_like(x, 1.0)], axis=-1)  # a metre above the ground

hours = np.zeros(points.shape[:2])
step = 0.5  # hours
for hour in np.arange(6.0, 18.0, step) + step / 2:
    angle = (hour - 12.0) / 12.0 * np.pi  # an equinox at 45 degrees north: X is east, Y is north
    sun = np.array([-np.sin(angle), -np.cos(angle) * np.sqrt(0.5), np.cos(angle) * np.sqrt(0.5)])
    hours += step * ~sync.scene.test_occlusions(points, sun)

save_png(folder / "sun_hours.png", to_colors(hours, 0, 12))
print(f"{hours.mean():.1f} hours of sun in the mean, {hours.max():.1f} at most")
