"""Put the rays into trimesh: an X-ray of nested shells, with how much of each ray is inside of the mesh."""

import numpy as np
import trimesh
from perfect_bvh.trimesh import RayMeshIntersector
from shared import read_arguments, save_png, to_colors

folder, width = read_arguments()
parts = [trimesh.creation.icosphere(radius=radius, subdivisions=4) for radius in (3.0, 2.5, 1.5)]
parts[1].invert()  # a hollow sphere with another inside
parts += [trimesh.creation.torus(4.0, 0.7), trimesh.creation.box(bounds=[[-6, -0.2, -0.2], [6, 0.2, 0.2]])]
mesh = trimesh.util.concatenate(parts)
mesh.ray = RayMeshIntersector(mesh)  # the one line that changes

x, y = np.meshgrid(np.linspace(-6, 6, width), np.linspace(-6, 6, width))
origins = np.stack([x, y, np.full_like(x, 10.0)], axis=-1).reshape(-1, 3)
directions = np.tile([0.0, 0.0, -1.0], (len(origins), 1))
places, rays, triangles = mesh.ray.intersects_location(origins, directions)  # all surfaces on each ray

leaves = mesh.face_normals[triangles, 2] < 0.0  # heights of ways in, less those of ways out
inside = np.bincount(rays, np.where(leaves, -1.0, 1.0) * places[:, 2], len(origins))
save_png(folder / "xray.png", to_colors(inside.reshape(width, width)))

through = np.array([[0.0, 0.0, 0.0]]), mesh.vertices[:1]  # exactly through a vertex
print(f"{len(places)} surfaces on {len(origins)} rays; {mesh.ray.intersects_any(*through).sum()} of 1 meets a vertex")
