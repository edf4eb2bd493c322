"""A room of many objects that hide each other, made from a seed, to measure label images on."""

from __future__ import annotations

import bpy
import numpy as np

KINDS = (
    lambda: bpy.ops.mesh.primitive_cube_add(),
    lambda: bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24),
    lambda: bpy.ops.mesh.primitive_torus_add(major_segments=64, minor_segments=24),
    lambda: bpy.ops.mesh.primitive_monkey_add(),
    lambda: bpy.ops.mesh.primitive_cone_add(vertices=64),
)
HALF = 4.0  # of the room's side
CATEGORIES = 12


def make_room(count: int, seed: int) -> list[bpy.types.Object]:
    """Opens an empty file and makes `count` things of five meshes before its camera, each with a `categoryID`."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene, random = bpy.context.scene, np.random.default_rng(seed)
    meshes = []
    for make in KINDS:
        make()
        meshes.append(bpy.context.object.data)
        bpy.data.objects.remove(bpy.context.object)
    things = []
    for number in range(count):
        thing = bpy.data.objects.new(f"Thing {number:04d}", meshes[number % len(meshes)])
        thing.location = random.uniform(-HALF, HALF, 3)
        thing.rotation_euler = random.uniform(0.0, 2.0 * np.pi, 3)
        thing.scale = [random.uniform(0.1, 0.5)] * 3
        thing["categoryID"] = int(random.integers(CATEGORIES))
        scene.collection.objects.link(thing)
        things.append(thing)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0.0, -4.0 * HALF, 0.0), (0.5 * np.pi, 0.0, 0.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return things
