"""Meshes that Blender makes from seeds: typical of users' meshes, without a download."""

from __future__ import annotations

import math
from pathlib import Path

import bpy  # brings mathutils with it
import numpy as np
from benchmarks.meshes import BenchMesh
from mathutils import Vector


def make_all(detail: float) -> list[BenchMesh]:
    """Displaced, instanced, hair and sticks; their numbers of triangles grow with `detail`."""
    return [displaced(detail), instanced(detail), hair(detail), sticks(detail)]


def import_file(path: Path, operator: str) -> BenchMesh:
    """Imports all objects of a file as one mesh."""
    _clear()
    getattr(bpy.ops.wm, operator)(filepath=str(path))
    return _evaluated(path.stem)


def open_scene(path: Path) -> BenchMesh:
    """Reads everything that a .blend file's scene shows in its current frame as one mesh."""
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    return _evaluated(path.stem)


def displaced(detail: float) -> BenchMesh:
    """A ball, subdivided and displaced by clouds: evenly tessellated, as sculpted and scanned things are."""
    _clear()
    bpy.ops.mesh.primitive_cube_add()
    smooth = bpy.context.object.modifiers.new("smooth", "SUBSURF")
    smooth.levels = max(1, round(7 + math.log(detail, 4)))  # each level has four times the triangles
    texture = bpy.data.textures.new("clouds", "CLOUDS")
    texture.noise_scale = 0.4
    modifier = bpy.context.object.modifiers.new("displace", "DISPLACE")
    modifier.texture, modifier.strength = texture, 0.5
    return _evaluated("displaced")


def instanced(detail: float) -> BenchMesh:
    """Monkeys over a plane, turned and sized at random, as one mesh: details with nothing between them."""
    _clear()
    bpy.ops.mesh.primitive_plane_add(size=40.0)
    bpy.ops.mesh.primitive_monkey_add()
    monkey = bpy.context.object
    random = np.random.default_rng(11)
    for _ in range(max(1, round(150 * detail)) - 1):
        copy = monkey.copy()
        bpy.context.collection.objects.link(copy)
        copy.location = (*random.uniform(-18.0, 18.0, 2), 1.0)
        copy.rotation_euler = random.uniform(0.0, math.tau, 3)
        copy.scale = [random.uniform(0.5, 2.0)] * 3
    return _evaluated("instanced")


def hair(detail: float) -> BenchMesh:
    """Strands on a ball, each a bent tube: long, thin and dense."""
    _clear()
    curve = bpy.data.curves.new("strands", "CURVE")
    curve.dimensions, curve.bevel_depth, curve.bevel_resolution = "3D", 0.002, 0
    random = np.random.default_rng(12)
    steps = np.linspace(0.0, 1.0, 9)[:, None]
    for _ in range(max(4, round(1200 * detail))):
        root = random.normal(size=3)
        root /= np.linalg.norm(root)
        bend = random.normal(0.0, 0.25, 3)
        points = root * (1.0 + 0.6 * steps) + bend * steps**2
        spline = curve.splines.new("POLY")
        spline.points.add(len(points) - 1)
        spline.points.foreach_set("co", np.hstack([points, np.ones_like(steps)]).astype(np.float32).ravel())
    bpy.context.collection.objects.link(bpy.data.objects.new("strands", curve))
    return _evaluated("hair")


def sticks(detail: float) -> BenchMesh:
    """Long thin sticks through one another in all directions: boxes fit them badly.

    Fewer than of the other meshes' parts: each lies in the boxes of hundreds, and end-point overlap counts them all.
    """
    _clear()
    bpy.ops.mesh.primitive_cylinder_add(vertices=6, radius=0.004, depth=1.0)
    stick, random = _evaluated("stick"), np.random.default_rng(13)
    count = max(4, round(1500 * detail))
    axes = random.normal(size=(count, 3))
    turns = np.array([Vector((0.0, 0.0, 1.0)).rotation_difference(Vector(axis)).to_matrix() for axis in axes])
    scales = np.stack([np.ones(count), np.ones(count), random.uniform(0.2, 1.5, count)], axis=-1)
    places = random.uniform(-1.0, 1.0, (count, 1, 3))
    positions = np.einsum("nij,nvj->nvi", turns, stick.positions[None] * scales[:, None]) + places
    firsts = len(stick.positions) * np.arange(count, dtype=np.int32)[:, None, None]
    return BenchMesh("sticks", positions.reshape(-1, 3).astype(np.float32), (stick.triangles + firsts).reshape(-1, 3))


def _clear() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)


def _evaluated(name: str) -> BenchMesh:
    """Everything that the scene shows, in world space, as one mesh."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    positions, triangles, first = [], [], 0
    for instance in depsgraph.object_instances:
        if instance.object.type not in ("MESH", "CURVE"):
            continue
        mesh = instance.object.to_mesh()
        points = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", points)
        mesh.calc_loop_triangles()
        corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
        mesh.loop_triangles.foreach_get("vertices", corners)
        matrix = np.array(instance.matrix_world)
        positions.append(points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3])
        triangles.append(corners.reshape(-1, 3) + first)
        first += len(mesh.vertices)
        instance.object.to_mesh_clear()
    return BenchMesh(name, np.concatenate(positions).astype(np.float32), np.concatenate(triangles).astype(np.int32))
