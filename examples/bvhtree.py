"""Change the import of a script that uses BVHTree, and drop its loop: normals of a monkey, and how far it is away."""

import bpy
import numpy as np
from perfect_bvh_addon import BVHTree  # instead of: from mathutils.bvhtree import BVHTree
from shared import read_arguments, save_png, to_colors

folder, width = read_arguments()
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.mesh.primitive_monkey_add()
bpy.context.object.modifiers.new("Smooth", "SUBSURF").levels = 3
tree = BVHTree.FromObject(bpy.context.object, bpy.context.evaluated_depsgraph_get())

x, z = np.meshgrid(np.linspace(-1.5, 1.5, width), np.linspace(1.2, -1.2, width * 4 // 5))
origins = np.stack([x, np.full_like(x, -5.0), z], axis=-1).reshape(-1, 3)
places, normals, polygons, distances = tree.ray_cast(origins, (0, 1, 0))  # all rays at once
image = np.where(polygons[:, None] >= 0, 0.5 + 0.5 * normals, 0.0)
save_png(folder / "bvhtree_normals.png", image.reshape(*x.shape, 3))

slice_points = np.stack([x, np.full_like(x, 0.2), z], axis=-1).reshape(-1, 3)
away = tree.find_nearest(slice_points)[3]
save_png(folder / "bvhtree_nearest.png", to_colors(away.reshape(x.shape), 0.0))

place, normal, polygon, distance = tree.ray_cast((0, -5, 0), (0, 1, 0))  # one ray, as before
print(f"polygon {polygon} at {distance:.3f}")
