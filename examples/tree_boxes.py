"""Draw the boxes of a real tree from above: the top level of a courtyard, level by level."""

import bpy
import numpy as np
import perfect_bvh_addon
from shared import SCENES, read_arguments, save_png, to_colors

folder, width = read_arguments(800)
bpy.ops.wm.open_mainfile(filepath=str(SCENES / "courtyard.blend"))
sync = perfect_bvh_addon.SceneSync()
sync.update(bpy.context.evaluated_depsgraph_get())
tree = sync.scene.snapshot().tree_boxes()  # of a mesh: tree_boxes(mesh_id), in the mesh's own space

colors = to_colors(-np.arange(tree.depth + 2.0))  # the root's is yellow
image = np.zeros((width, width, 3))
for level in range(tree.depth, -1, -1):  # the root last
    boxes = tree.boxes[tree.levels == level][..., :2]
    corners = np.clip(np.round((boxes + 15.0) / 30.0 * (width - 1)), 0, width - 1).astype(int)
    for (left, bottom), (right, top) in corners:
        image[[width - 1 - bottom, width - 1 - top], left : right + 1] = colors[level]
        image[width - 1 - top : width - bottom, [left, right]] = colors[level]
    print(f"level {level}: {len(boxes)} boxes")
save_png(folder / "tree_boxes.png", image)
print(f"a random ray through the root's box is expected to cost {tree.sah:.1f} visits and tests")
