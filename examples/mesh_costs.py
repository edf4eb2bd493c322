"""Find the objects whose trees cost the camera's rays most, and what each tree took to build."""

import csv

import bpy
import numpy as np
import perfect_bvh_addon
from shared import SCENES, read_arguments, save_png, to_colors

folder, width = read_arguments()
bpy.ops.wm.open_mainfile(filepath=str(SCENES / "courtyard.blend"))
sync = perfect_bvh_addon.SceneSync()
size = (width, width * 9 // 16)
report = sync.update(bpy.context.evaluated_depsgraph_get(), size=size)

fields = ("instance_ids", "nodes_visited", "primitives_tested")
hits = sync.scene.cast_rays(*sync.camera.pixel_rays(size), fields=fields)
tests = hits.nodes_visited + hits.primitives_tested  # of the whole ray, counted for the object that it hits
save_png(folder / "mesh_costs.png", to_colors(np.log2(1.0 + tests)))

names = np.where(hits.is_hit, sync.describe(hits.instance_ids).names, "(nothing)").astype(str)
objects, owners = np.unique(names, return_inverse=True)
totals, pixels = (np.bincount(owners.ravel(), weights) for weights in (tests.ravel(), None))
with (folder / "mesh_costs.csv").open("w", newline="") as file:
    writer = csv.writer(file)
    writer.writerow(("object", "pixels", "tests", "tests a ray"))
    for row in np.argsort(-totals):
        writer.writerow((objects[row], pixels[row], int(totals[row]), f"{totals[row] / pixels[row]:.1f}"))
first = np.argmax(totals)
print(f"{objects[first]} takes {totals[first] / totals.sum():.0%} of the tests")
slowest = max(report.commit.meshes, key=lambda mesh: mesh.milliseconds)
name = next(mesh.name for mesh in report.meshes if mesh.mesh_id == slowest.mesh_id)
print(f"{name} took longest to build: {slowest.triangle_count} triangles, by {slowest.builder}: {slowest.reason}")
