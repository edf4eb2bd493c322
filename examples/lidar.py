"""Scan a scene by a LiDAR from the list; a third argument names another one or your own sensor file."""

import sys

import bpy
import numpy as np
from perfect_bvh_addon import load_sensor, save_cloud, scan, sensor_names
from shared import SCENES, id_colors, read_arguments, save_png

folder, width = read_arguments()
bpy.ops.wm.open_mainfile(filepath=str(SCENES / "courtyard.blend"))
mount = bpy.data.objects.new("Mount", None)
mount.location = (0.0, -3.0, 1.7)
bpy.context.scene.collection.objects.link(mount)

print("sensors:", *sensor_names())
sensor = load_sensor(sys.argv[3] if len(sys.argv) > 3 else "spinning-64")
cloud = scan(sensor, mount, labels=("collection",), seed=7)
save_cloud(cloud, folder / "lidar.ply")  # also .las, .csv, .npz; .laz, .parquet and .h5 by further libraries

pixels = np.round((cloud.positions[:, :2] + 12.0) / 24.0 * (width - 1)).astype(int)
order = np.argsort(cloud.positions[:, 2])  # higher points hide lower ones
order = order[((pixels >= 0) & (pixels < width)).all(axis=1)[order]]
image = np.zeros((width, width, 3))
image[width - 1 - pixels[order, 1], pixels[order, 0]] = id_colors(cloud.object_ids[order])
save_png(folder / "lidar.png", image)
print(f"{len(cloud)} points on {len(cloud.object_names)} objects from {cloud.ray_count} rays")
