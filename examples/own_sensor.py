"""Describe a sensor in a file, scan by it, and look at what became of its rays."""

import dataclasses

import bpy
import numpy as np
from perfect_bvh_addon import load_sensor, scan
from shared import SCENES, read_arguments, save_png, to_colors

SENSOR = """
title = "Mine"
kind = "spinning"
elevations = { first = -30.0, last = 30.0, count = 96 }  # degrees
columns = COLUMNS  # in a turn
rate = 10.0  # turns a second
min_distance = 0.5  # metres
max_distance = 60.0

[beam]
divergence = 3.0  # milliradians
rays = 5  # per beam
returns = 2
keep = ["strongest", "last"]
resolution = 0.5  # metres: nearer echoes are one

[detection]  # the least reflectivity that is detected at each distance
distances = [5.0, 20.0, 60.0]
reflectivities = [0.005, 0.05, 0.4]

[noise]
range = 0.02  # metres
dropout = 0.01
"""

folder, width = read_arguments(900)
path = folder / "mine.toml"
path.write_text(SENSOR.replace("COLUMNS", str(width)))
bpy.ops.wm.open_mainfile(filepath=str(SCENES / "courtyard.blend"))
mount = bpy.data.objects.new("Mount", None)
mount.location = (0.0, -3.0, 1.7)
bpy.context.scene.collection.objects.link(mount)

cloud = scan(load_sensor(path), mount, seed=1)
ranges = np.full((96, width), np.nan)
ranges[95 - cloud.ring_ids, width - 1 - cloud.ray_ids // 96] = cloud.distances  # rays go column by column, to the left
save_png(folder / "own_sensor.png", to_colors(np.repeat(np.log2(ranges), 2, axis=0)))
print(*(f"{count} {outcome}" for outcome, count in dataclasses.asdict(cloud.ray_outcomes).items() if count), sep=", ")
