"""Check a plan of photographs: how many of its cameras see each place of a courtyard."""

import csv

import bpy
import numpy as np
import perfect_bvh
import perfect_bvh_addon
from shared import SCENES, read_arguments, save_png, to_colors

folder, width = read_arguments()
bpy.ops.wm.open_mainfile(filepath=str(SCENES / "courtyard.blend"))
sync = perfect_bvh_addon.SceneSync()
sync.update(bpy.context.evaluated_depsgraph_get())

x, y = np.meshgrid(np.linspace(-10, 10, width), np.linspace(10, -10, width))
fields = ("instance_ids", "positions", "geometric_normals")
ground = sync.scene.cast_rays(np.stack([x, y, np.full_like(x, 100.0)], axis=-1), [0.0, 0.0, -1.0], fields=fields)
places = ground.positions + 1e-3 * ground.geometric_normals

counts, rows = np.zeros(x.shape), [("camera", "x", "y", "z", "share seen")]
for number, angle in enumerate(np.linspace(0, 2 * np.pi, 12, endpoint=False)):
    position = np.array([9 * np.cos(angle), 9 * np.sin(angle), 15.0])
    camera = perfect_bvh.Camera.look_at(position, (0, 0, 0), angle=np.radians(75), aspect=1.5)
    local = (places - position) @ camera.matrix[:3, :3]  # right, up, backward
    u, v = (local[..., axis] / -local[..., 2] for axis in (0, 1))
    left, right, bottom, top = camera.window
    is_inside = (local[..., 2] < 0) & (left < u) & (u < right) & (bottom < v) & (v < top)
    is_steep = np.sum(ground.geometric_normals * (position - places), axis=-1) > 0.3 * np.linalg.norm(local, axis=-1)
    is_hidden = sync.scene.test_occlusions(places, position - places, t_max=1.0)
    is_seen = is_inside & is_steep & ~is_hidden & ground.is_hit
    counts += is_seen
    rows.append((number, *position.round(2), f"{is_seen.mean():.3f}"))

with (folder / "photogrammetry.csv").open("w", newline="") as file:
    csv.writer(file).writerows(rows)
save_png(folder / "photogrammetry.png", to_colors(counts, 0, 12))
print(f"{np.mean(counts >= 3):.0%} of the places are seen by three cameras or more, {np.mean(counts == 0):.0%} by none")
