"""Compare builders: what a tree by each of them costs to build, and its rays to trace, over sticks in hills.

The picture has what each ray visits: by median, binned, sweep, fast and spatial, from left to right.
"""

import csv
import time

import numpy as np
import perfect_bvh
from shared import make_hills, read_arguments, save_png, to_colors

folder, width = read_arguments(320)
random = np.random.default_rng(1)
hills, triangles = make_hills(width // 2)
ends = random.uniform((-9, -9, 0), (9, 9, 4), (5 * width, 1, 3))
sticks = ends + random.normal(0, 1, (len(ends), 3, 3)) * np.array([[0.02], [0.02], [1.5]])  # long and thin
positions = np.concatenate([hills, sticks.reshape(-1, 3)])
triangles = np.concatenate([triangles, np.arange(3 * len(ends)).reshape(-1, 3) + len(hills)])
origins, directions = perfect_bvh.Camera.look_at((14, -16, 9), (0, 0, 0)).pixel_rays((width, width * 9 // 16))

rows, pictures = [], []
for builder in ("median", "binned", "sweep", "fast", "spatial"):
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(positions, triangles, build=perfect_bvh.BuildConfig(builder=builder)))
    started = time.perf_counter()
    scene.commit()
    seconds = time.perf_counter() - started
    hits = scene.cast_rays(origins, directions, fields=("nodes_visited", "primitives_tested"))
    tree = scene.statistics().meshes[0]
    tests = hits.nodes_visited + hits.primitives_tested
    rows.append((builder, f"{seconds * 1000:.1f}", f"{tree.sah:.2f}", f"{tests.mean():.1f}", tree.byte_count))
    pictures.append(to_colors(np.log2(1.0 + tests), 0, 8))

names = ("builder", "milliseconds", "sah", "tests a ray", "bytes")
with (folder / "compare_builders.csv").open("w", newline="") as file:
    csv.writer(file).writerows([names, *rows])
save_png(folder / "compare_builders.png", np.concatenate(pictures, axis=1))
for row in (names, *rows):
    print(*(f"{value!s:>14}" for value in row))
