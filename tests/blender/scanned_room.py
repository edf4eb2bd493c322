"""Shared helpers for tests of scans: a room with a camera and a lidar's mount, and the points of a scan."""

from __future__ import annotations

import math
from collections.abc import Iterator

import bpy
import numpy as np
from perfect_bvh_addon import SpinningLidar

LIDAR = SpinningLidar(elevations=(-30.0, -10.0, 0.0, 20.0), columns=36, rate=10.0)


def furnish(scene: bpy.types.Scene) -> bpy.types.Scene:
    """Build a ground, a red and a white cube with separate meshes, and a camera and an empty, turned and scaled."""
    bpy.ops.mesh.primitive_plane_add(size=40.0)
    for name, place in (("Red", (4.0, 0.0, 1.0)), ("White", (0.0, 5.0, 1.5))):
        bpy.ops.mesh.primitive_cube_add(location=place, rotation=(0.1, 0.2, 0.3))
        bpy.context.object.name = name
    material = bpy.data.materials.new("red")
    bpy.data.objects["Red"].data.materials.append(material)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler, camera.scale = (-6.0, -6.0, 4.0), (1.1, 0.05, -0.8), (2.0, 2.0, 2.0)
    empty = bpy.data.objects.new("Head", None)
    empty.location, empty.rotation_euler, empty.scale = (0.0, 0.0, 1.5), (0.1, -0.05, 0.4), (3.0, 1.0, 0.5)
    for obj in (camera, empty):
        scene.collection.objects.link(obj)
    scene.camera = camera
    scene.frame_end = 3
    bpy.context.view_layer.update()
    return scene


def lidar_rays(
    head: bpy.types.Object, pattern: SpinningLidar, columns: range
) -> Iterator[tuple[np.ndarray, np.ndarray, float]]:
    """Compute (origin, direction, distance) of each ray from the definition: forward is the object's +Y, up its +Z.

    The lidar turns to the left.
    """
    turn = np.array(head.matrix_world.normalized())
    for column in columns:
        azimuth = math.radians(((column % pattern.columns + 0.5) / pattern.columns - 0.5) * pattern.sweep)
        for angle in pattern.elevations:
            up = math.radians(angle)
            local = (-math.sin(azimuth) * math.cos(up), math.cos(azimuth) * math.cos(up), math.sin(up))
            yield turn[:3, 3], turn[:3, :3] @ local, min(pattern.max_distance, 1e6)


def values_of(obj: bpy.types.Object, attribute: str, field: str, width: int = 1) -> np.ndarray:
    """Return an attribute of a scan's points, (N,) or (N, width)."""
    found = obj.data.attributes[attribute]
    values = np.empty(len(found.data) * width, np.int32 if found.data_type == "INT" else np.float32)
    found.data.foreach_get(field, values)
    return values if width == 1 else values.reshape(-1, width)
