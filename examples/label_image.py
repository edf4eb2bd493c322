"""Label what a camera sees: exact ids and depths, and masks of the hidden parts as well."""

import bpy
import numpy as np
from perfect_bvh_addon import label_image
from shared import SCENES, id_colors, read_arguments, save_png, to_colors

folder, width = read_arguments()
bpy.ops.wm.open_mainfile(filepath=str(SCENES / "courtyard.blend"))
labels = label_image(size=(width, width * 9 // 16), layers=4, labels=("collection",))
labels.save(folder / "label_image.npz")

save_png(folder / "label_ids.png", id_colors(labels.thing_ids))
save_png(folder / "label_depth.png", to_colors(np.log2(np.where(labels.depth < 1e9, labels.depth, np.nan))))

shares = labels.visible_shares
row = int(np.argmax(np.where((shares > 0.05) & (shares < 0.6), labels.amodal.areas, 0)))  # half hidden
masks = [mask.image_of(row) for mask in (labels.amodal, labels.visible)]
save_png(folder / "label_hidden.png", 0.3 * id_colors(labels.thing_ids) + 0.35 * np.sum(masks, axis=0)[..., None])
count = np.sum(shares == 0)
print(f"{len(labels.things)} instances on rays of the camera, {count} of them hidden altogether")
print(f"{labels.things[row].name}: {shares[row]:.0%} of it is visible")
