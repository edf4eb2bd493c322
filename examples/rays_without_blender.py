"""Cast rays without Blender: hills and spheres from numpy arrays, with a shadow ray for each hit."""

import numpy as np
import perfect_bvh
from shared import id_colors, make_hills, read_arguments, save_png

folder, width = read_arguments()
random = np.random.default_rng(1)

scene = perfect_bvh.Scene()
hills = scene.add_mesh(*make_hills(300))
spheres = scene.add_points(random.uniform((-9, -9, 1.5), (9, 9, 3), (60, 3)), random.uniform(0.2, 0.8, 60))
scene.add_instance(hills)
scene.add_instance(spheres)
scene.commit()  # builds the trees

camera = perfect_bvh.Camera.look_at((14, -16, 9), (0, 0, 0))
origins, directions = camera.pixel_rays((width, width * 9 // 16))  # any (..., 3) arrays will do
hits = scene.cast_rays(origins, directions, fields=("positions", "geometric_normals", "mesh_ids", "primitive_ids"))

sun = np.array([0.6, -0.3, 0.7])
normals = hits.geometric_normals
is_lit = ~scene.test_occlusions(hits.positions + 1e-4 * normals, sun)
light = 0.25 + 0.75 * np.clip(normals @ sun, 0, 1) * is_lit
colors = np.where((hits.mesh_ids == hills)[..., None], (0.5, 0.65, 0.35), id_colors(hits.primitive_ids))
save_png(
    folder / "rays_without_blender.png", np.where(hits.is_hit[..., None], colors * light[..., None], (0.7, 0.8, 1))
)
print(f"{hits.is_hit.mean():.0%} of {hits.is_hit.size} rays hit, {np.mean(hits.is_hit & ~is_lit):.0%} in shadow")
