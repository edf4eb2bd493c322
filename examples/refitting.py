"""See where refitting fails: hills in waves keep a good tree, triangles that fly apart ruin it.

The picture has what each ray visits: waves above, flight below; on the left only refits, on the right what pays.
"""

import csv

import numpy as np
import perfect_bvh
from shared import make_hills, read_arguments, save_png, to_colors

folder, width = read_arguments(320)
start, triangles = make_hills(80)
start, triangles = start[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3)  # no shared vertices
flights = np.repeat(np.random.default_rng(1).normal(0, 1, (len(triangles), 3)), 3, axis=0)
origins, directions = perfect_bvh.Camera.look_at((14, -16, 9), (0, 0, 0)).pixel_rays((width, width * 9 // 16))

rows, pictures = [("motion", "step", "expected rays", "action", "cost when built", "cost now", "reason")], []
for motion in ("waves", "flight"):
    for expected_rays in (1, 10**8):  # for one ray nothing but a refit pays
        scene = perfect_bvh.Scene()
        mesh = scene.add_mesh(start, triangles, usage="deforming")
        scene.add_instance(mesh)
        scene.commit(expected_rays)
        for step in range(1, 9):
            lift = np.sin(start[:, :1] + 0.2 * step) * (0, 0, 0.5)
            scene.update_mesh(mesh, start + (lift if motion == "waves" else 0.1 * step * flights))
            (report,) = scene.commit(expected_rays).meshes
            costs = (f"{report.fresh_cost:.2f}", f"{report.cost:.2f}")
            rows.append((motion, step, expected_rays, report.action, *costs, report.reason))
        hits = scene.cast_rays(origins, directions, fields=("nodes_visited", "primitives_tested"))
        pictures.append(to_colors(np.log2(1.0 + hits.nodes_visited + hits.primitives_tested), 0, 9))
        print(*(f"{value!s:>10}" for value in rows[-1][:-1]))

with (folder / "refitting.csv").open("w", newline="") as file:
    csv.writer(file).writerows(rows)
left, right = (np.concatenate(pictures[column::2], axis=0) for column in (0, 1))  # refitted alone, and as it pays
save_png(folder / "refitting.png", np.concatenate([left, right], axis=1))
