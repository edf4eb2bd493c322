"""Fit the tables of `native/src/render/surface/coating.cpp` to the sheen that Cycles renders, and print them.

    python tests/blender/fit_sheen.py

A sphere of a Sheen BSDF shows all angles to the camera and to a sun without size: one sample of a pixel is the lobe's
value. For each roughness and cosine a linearly transformed cosine is fitted whose square roots are linear in three
numbers. A linear spline with the engine's knots is fitted to all of them by least squares.
"""

from __future__ import annotations

import sys
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from blender.node_setups import add, new_red, surface
from oracles.cycles import FILTER_WIDTH, render_planes

Array = npt.NDArray[np.float64]

ROUGHNESSES = (0.1, 0.12, 0.16, *np.arange(0.2, 1.01, 0.05).round(2).tolist())
TILTS = (0.0, 0.5, 1.0, 1.5, 2.0)  # of the sun, in radians
COSINES = np.linspace(0.04, 0.98, 24)
KNOTS = (0.0, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0)
ALBEDO_KNOTS = (0.1, 0.15, 0.2, 0.26, 0.33, 0.42, 0.54, 0.68, 0.84, 1.0)
SHAPE_KNOTS = (0.1, 0.2, 0.35, 0.6, 1.0)


def make_ball() -> tuple[Any, Any, Any]:
    """The scene, the shader node and the sun."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=7, radius=1.0)
    bpy.context.object.data.shade_smooth()
    material = new_red()
    bpy.context.object.data.materials.append(material)
    node = add(material.node_tree, "BsdfSheen", Color=(1.0, 1.0, 1.0, 1.0))
    material.node_tree.links.new(node.outputs[0], surface(material))
    bpy.ops.object.light_add(type="SUN")
    sun = bpy.context.object
    sun.data.angle, sun.data.energy = 0.0, 1.0
    bpy.ops.object.camera_add(location=(0.0, 0.0, 6.0))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 2.0
    scene.render.resolution_x = scene.render.resolution_y = 96
    scene.cycles.samples, scene.cycles.filter_width, scene.cycles.max_bounces = 1, FILTER_WIDTH, 0
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.world = bpy.data.worlds.new("World")
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
    return scene, node, sun


def measure(scene: Any, sun: Any) -> Array:
    """(N, 5): cosines to the viewer, directions to the sun in the normal's frame with x to the viewer, and values."""
    rows = []
    for tilt in TILTS:
        sun.rotation_euler = (tilt, 0.0, 0.0)
        bpy.context.view_layer.update()
        light = np.array(sun.matrix_world.to_3x3().col[2])
        planes = render_planes(scene, "CYCLES", ["Combined.R", "Normal.X", "Normal.Y", "Normal.Z"])
        normals = np.stack([planes[f"Normal.{axis}"] for axis in "XYZ"], axis=-1).reshape(-1, 3).astype(np.float64)
        values = planes["Combined.R"].ravel().astype(np.float64)
        seen = (normals @ light > 0.12) & (normals[:, 2] > 0.02) & (values > 0.0)
        normals, values = normals[seen], values[seen]
        along = np.array((0.0, 0.0, 1.0)) - normals * normals[:, 2:]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        parts = [along @ light, np.cross(normals, along) @ light, normals @ light]
        rows.append(np.stack([normals[:, 2], *parts, values], axis=1))
    return np.concatenate(rows)


def lobe_of(rows: Array) -> tuple[float, float, float]:
    """Albedo, scale and shear of the lobe through values at one cosine."""
    x, y, z = rows[:, 1], rows[:, 2], rows[:, 3]
    roots = np.sqrt(z / (np.pi * rows[:, 4]))
    terms = np.stack([x * x + y * y, x * z, z * z], axis=1) / roots[:, None]
    first, second, third = np.linalg.lstsq(terms, np.ones(len(rows)), rcond=None)[0]
    slope = second / (2.0 * first)
    scale = 1.0 / np.sqrt(third / first - slope * slope)
    return (scale / first) ** 2, scale, slope * scale


def hats(places: Array, knots: tuple[float, ...]) -> Array:
    """(N, K): the weights of a linear spline's knots."""
    return np.stack([np.interp(places, knots, row) for row in np.eye(len(knots))], axis=1)


def spline(lobes: Array, values: Array, weights: Array, knots: tuple[float, ...]) -> Array:
    """(K, 7): the spline through values of lobes by their roughness and cosine."""
    rows = (hats(lobes[:, 0], knots)[:, :, None] * hats(lobes[:, 1], KNOTS)[:, None, :]).reshape(len(lobes), -1)
    size = rows.shape[1]
    system = np.concatenate([rows * weights[:, None], np.eye(size) * 1e-4])
    wanted = np.concatenate([values * weights, np.zeros(size)])
    return np.linalg.lstsq(system, wanted, rcond=None)[0].reshape(len(knots), -1)


def main() -> None:
    scene, node, sun = make_ball()
    found = []
    for roughness in ROUGHNESSES:
        node.inputs["Roughness"].default_value = roughness
        rows = measure(scene, sun)
        near = [(cosine, rows[np.abs(rows[:, 0] - cosine) < 0.012]) for cosine in COSINES]
        found += [(roughness, cosine, *lobe_of(part)) for cosine, part in near if len(part) > 40]
    lobes = np.array([lobe for lobe in found if 1e-7 < lobe[2] < 1.0])
    albedos, depths = lobes[:, 2], np.sqrt(-np.log(lobes[:, 2]))
    seen = np.sqrt(lobes[:, 1] + 0.05)
    tables = [spline(lobes, depths, 2.0 * albedos * depths / (albedos + 0.02) * seen + 1e-3, ALBEDO_KNOTS)]
    tables += [spline(lobes, lobes[:, column], np.sqrt(albedos) * seen + 1e-3, SHAPE_KNOTS) for column in (3, 4)]
    sys.stdout.write("\n".join(str(table.round(3)) for table in tables) + "\n")


if __name__ == "__main__":
    main()
