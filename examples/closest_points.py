"""Measure distances to a surface: a vertical slice through hills, with a line each half unit."""

import numpy as np
import perfect_bvh
from shared import make_hills, read_arguments, save_png, to_colors

folder, width = read_arguments()
scene = perfect_bvh.Scene()
scene.add_instance(scene.add_mesh(*make_hills(200)))
scene.commit()

x, z = np.meshgrid(np.linspace(-10, 10, width), np.linspace(5, -5, width // 2))
points = np.stack([x, np.zeros_like(x), z], axis=-1)  # any (..., 3) array
nearest = scene.compute_closest_points(points, max_distance=4.0)  # the smaller, the faster

distances = np.where(nearest.is_found, nearest.distances, np.nan)
is_line = np.abs(distances - 0.5 * np.round(2 * distances)) < 10 / width
save_png(folder / "closest_points.png", to_colors(distances) * np.where(is_line, 0.6, 1.0)[..., None])
row, column = np.unravel_index(np.nanargmax(distances), distances.shape)
print(f"{points[row, column].round(2)} is {distances[row, column]:.3f} from {nearest.points[row, column].round(2)}")
