"""Drive through a crowd with a LiDAR and a camera, as a data set of KITTI, and draw its points and boxes."""

import bpy
import numpy as np
from perfect_bvh_addon.cli import main
from shared import SCENES, read_arguments, save_png, to_colors

folder, width = read_arguments()
bpy.ops.wm.open_mainfile(filepath=str(SCENES / "crowd.blend"))
scene, mount = bpy.context.scene, bpy.data.objects.new("Mount", None)
scene.collection.objects.link(mount)
for frame, y in ((1, -8.0), (48, 2.0)):
    mount.location = (0.0, y, 1.7)
    mount.keyframe_insert("location", frame=frame)
scene.camera.parent, scene.camera.location, scene.camera.rotation_euler = mount, (0, 0.2, 0), (np.pi / 2, 0, 0)
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, width * 9 // 16, 100
for thing in bpy.data.objects:
    if thing.name.startswith("Player"):
        thing["class"] = "Pedestrian"
bpy.ops.wm.save_as_mainfile(filepath=str(folder / "drive.blend"))

arguments = ["scan", str(folder / "drive.blend"), "-o", str(folder / "kitti"), "--format", "kitti", "--on", "Mount"]
main([*arguments, "--sensor", "spinning-64", "--category", "class", "--frames", "1-3", "--seed", "7", "-q"])

training = folder / "kitti" / "training"
lines = (training / "calib" / "000001.txt").read_text().splitlines()
matrices = {name: np.array(row.split(), float).reshape(3, -1) for name, row in (line.split(": ") for line in lines)}
points = np.fromfile(training / "velodyne" / "000001.bin", np.float32).reshape(-1, 4)
ahead = np.c_[points[:, :3], np.ones(len(points))] @ matrices["Tr_velo_to_cam"].T
ahead = ahead[ahead[:, 2] > 0.5]
rows = [line.split() for line in (training / "label_2" / "000001.txt").read_text().splitlines()]
corners = np.array(np.meshgrid([-0.5, 0.5], [0, -1], [-0.5, 0.5])).reshape(3, 8).T
edges = []
for height, box_width, length, *place, turn in (map(float, row[8:15]) for row in rows):
    axes = [[np.cos(turn), 0, -np.sin(turn)], [0, 1, 0], [np.sin(turn), 0, np.cos(turn)]]
    box = corners * [length, height, box_width] @ axes + place
    pairs = [(a, b) for a in range(8) for b in range(a) if np.count_nonzero(corners[a] != corners[b]) == 1]
    edges += [box[a] + share * (box[b] - box[a]) for a, b in pairs for share in np.linspace(0, 1, width)]

picture = bpy.data.images.load(str(training / "image_2" / "000001.png"))
image = 0.6 * np.array(picture.pixels).reshape(width * 9 // 16, width, -1)[::-1, :, :3]
for shown, colors in ((ahead, to_colors(np.log(ahead[:, 2]))), (np.array(edges), np.array([[1, 0.9, 0.2]]))):
    pixels = np.c_[shown, np.ones(len(shown))] @ matrices["P2"].T
    x, y = np.round(pixels[:, :2] / pixels[:, 2:]).astype(int).T
    is_in = (shown[:, 2] > 0.1) & (x >= 0) & (x < width) & (y >= 0) & (y < len(image))
    image[y[is_in], x[is_in]] = np.broadcast_to(colors, shown.shape)[is_in]
save_png(folder / "drive.png", image)
print(f"{len(points)} points and {len(rows)} boxes in the first of three frames")
