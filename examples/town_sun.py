"""Bake the hours of sun onto each face of a quarter of a town: on 21 March and over a year."""

from datetime import date

import bpy
import numpy as np
from perfect_bvh_addon import Place, SceneSync, bake_rays, sun_table
from shared import SCENES, read_arguments, save_png, to_colors

folder, width = read_arguments()
bpy.ops.wm.open_mainfile(filepath=str(SCENES / "town.blend"))
houses = [obj for obj in bpy.context.scene.objects if obj.type == "MESH"]
place = Place(52.52, 13.405, "Europe/Berlin")
tables = {
    "21_march": sun_table(place, date(2026, 3, 21)),
    "year": sun_table(place, date(2026, 1, 1), date(2026, 12, 31), step=180),
}

sync = SceneSync()
size = (width, width * 9 // 16)
sync.update(bpy.context.evaluated_depsgraph_get(), size=size)
hits = sync.scene.cast_rays(*sync.camera.pixel_rays(size))
names, faces = sync.describe(hits.instance_ids).names, sync.polygon_ids(hits)

for name, table in tables.items():
    bake = bake_rays(houses, kind="SUN_HOURS", directions=table)
    bake.write_csv(folder / f"sun_{name}.csv")
    bake.write_attributes(f"sun_{name}")  # of the open scene: in Blender, Solid shading and materials can show it
    image = np.full(faces.shape, np.nan)
    for baked in bake.objects:
        is_here = hits.is_hit & (names == baked.name)
        image[is_here] = baked.values[faces[is_here]]
    save_png(folder / f"sun_{name}.png", to_colors(image, 0.0, table.weights.sum()))
    court = bake["Court"].values
    print(f"{name}: the court has {court.min():.0f} to {court.max():.0f} of {table.weights.sum():.0f} hours")
