"""Fit the tables of `native/src/render/surface/coating.cpp` to the sheen that Cycles renders, and print them.

    python tests/blender/fit_sheen.py

Each pixel looks at a small square of a Sheen BSDF: columns are tilted, rows are rougher. A white world shows the lobe's
albedo, and suns without size show its values, both without noise. From them follow the two numbers of its linearly
transformed cosine. Splines with the engine's knots are fitted to all by least squares.
"""

from __future__ import annotations

import math
import sys
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from blender.node_setups import add, new_red, surface
from oracles.cycles import FILTER_WIDTH, preserved, render_planes

Array = npt.NDArray[np.float64]

LEAST_ROUGHNESS, KNOTS = 0.09, 8
COSINES = (np.arange(64) + 0.5) / 64.0
ROUGHNESSES = LEAST_ROUGHNESS + (1.0 - LEAST_ROUGHNESS) * np.linspace(0.0, 1.0, 64)
SUNS = [(tilt, around) for tilt in (0.0, 0.4, 0.8, 1.2) for around in (0.0, 1.5, 3.1, 4.7)]  # in radians


def make_squares() -> Any:
    """Make the scene; the square of a pixel faces up, tilted towards +X."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(64.0), np.arange(64.0)))
    cosines, roughnesses = np.tile(COSINES, 64), np.repeat(ROUGHNESSES, 64)
    half = np.minimum(0.45 / cosines, 10.0)
    along = np.stack([half * cosines, 0.0 * half, -half * np.sqrt(1.0 - cosines**2)], axis=1)
    middle, across = np.stack([x, y, 0.0 * x], axis=1), np.array([0.0, 0.45, 0.0])
    corners = [middle - along - across, middle + along - across, middle + along + across, middle - along + across]
    mesh = bpy.data.meshes.new("Squares")
    mesh.from_pydata(np.stack(corners, axis=1).reshape(-1, 3).tolist(), [], np.arange(4 * 4096).reshape(-1, 4).tolist())
    mesh.attributes.new("rough", "FLOAT", "FACE").data.foreach_set("value", roughnesses.astype(np.float32))
    material = new_red()
    mesh.materials.append(material)
    squares = bpy.data.objects.new("Squares", mesh)
    squares.visible_diffuse = squares.visible_shadow = False
    scene.collection.objects.link(squares)
    node, rough = add(material.node_tree, "BsdfSheen", Color=(1.0, 1.0, 1.0, 1.0)), add(material.node_tree, "Attribute")
    rough.attribute_name = "rough"
    material.node_tree.links.new(rough.outputs["Fac"], node.inputs["Roughness"])
    material.node_tree.links.new(node.outputs[0], surface(material))
    bpy.ops.object.light_add(type="SUN")
    bpy.context.object.data.angle = 0.0
    bpy.ops.object.camera_add(location=(31.5, 31.5, 40.0))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 64.0
    scene.render.resolution_x = scene.render.resolution_y = 64
    scene.cycles.samples, scene.cycles.filter_width = 1, FILTER_WIDTH
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.world = bpy.data.worlds.new("World")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    scene.world.cycles.sampling_method = "NONE"
    return scene


def render(scene: Any, strength: float, energy: float) -> Array:
    """Render (roughnesses, cosines), under a world and a sun."""
    sky = scene.world.node_tree.nodes["Background"].inputs["Strength"]
    with preserved((bpy.data.lights["Sun"], "energy", energy), (sky, "default_value", strength)):
        found: Array = render_planes(scene, "CYCLES", ["Combined.R"])["Combined.R"][::-1].astype(np.float64)
    return found


def lobes(scene: Any) -> tuple[Array, Array, Array]:
    """Return albedos, scales and shears, (roughnesses, cosines), NaN where too few suns are seen."""
    albedos = render(scene, 1.0, 0.0)
    scales, shears = np.full((2, *albedos.shape), np.nan)
    sun, seen = bpy.data.objects["Sun"], []
    for tilt, around in SUNS:
        sun.rotation_euler = (0.0, tilt, around)
        bpy.context.view_layer.update()
        x, y, z = sun.matrix_world.to_3x3().col[2]
        # In the frame of a square whose normal has this cosine: x towards the viewer's side.
        sine = np.sqrt(1.0 - COSINES**2)
        out = np.stack([COSINES * -x + sine * z, 0.0 * COSINES + y, sine * x + COSINES * z], axis=1)
        seen.append((out, render(scene, 0.0, 1.0)))
    for row, column in np.ndindex(albedos.shape):
        rows = np.array([(*out[column], values[row, column]) for out, values in seen])
        rows = rows[(rows[:, 2] > 0.02) & (rows[:, 3] > 0.0)]
        if len(rows) >= 6 and albedos[row, column] > 1e-6:
            scales[row, column], shears[row, column] = lobe_of(rows)
    return albedos, scales, shears


def lobe_of(rows: Array) -> tuple[float, float]:
    """Scale and shear of the lobe through values in directions."""
    x, y, z = rows[:, 0], rows[:, 1], rows[:, 2]
    terms = np.stack([x * x + y * y, x * z, z * z], axis=1) / np.sqrt(z / (np.pi * rows[:, 3]))[:, None]
    first, second, third = np.linalg.lstsq(terms, np.ones(len(rows)), rcond=None)[0]
    slope = second / (2.0 * first)
    left = third / first - slope * slope
    return (left**-0.5, slope * left**-0.5) if left > 0.0 else (math.nan, math.nan)


def weights(places: Array) -> Array:
    """(N, KNOTS): those of a quadratic B-spline's knots, at 0 to 1."""
    along = np.clip(places, 0.0, 1.0) * (KNOTS - 2)
    low = np.minimum(along.astype(int), KNOTS - 3)
    part = along - low
    found = np.zeros((len(places), KNOTS))
    shares = 0.5 * (1.0 - part) ** 2, 0.5 + part - part * part, 0.5 * part * part
    for step, share in enumerate(shares):
        found[np.arange(len(places)), low + step] = share
    return found


def fit(values: Array, importance: Array) -> Array:
    """(KNOTS, KNOTS): the spline's numbers by roughness and cosine."""
    least = math.sqrt(LEAST_ROUGHNESS)
    down, across = weights((np.sqrt(ROUGHNESSES) - least) / (1.0 - least)), weights(np.sqrt(COSINES))
    matrix = (down[:, None, :, None] * across[None, :, None, :]).reshape(values.size, -1)
    known = np.isfinite(values).ravel()
    matrix, wanted, importance = matrix[known], values.ravel()[known], importance.ravel()[known]
    # Little curvature where nothing is seen.
    bend = np.diff(np.eye(KNOTS), 2, axis=0) * 1e-4
    smooth = np.concatenate([np.kron(bend, np.eye(KNOTS)), np.kron(np.eye(KNOTS), bend)])
    system = np.concatenate([matrix * importance[:, None], smooth])
    found: Array = np.linalg.lstsq(system, np.append(wanted * importance, np.zeros(len(smooth))), rcond=None)[0]
    return found.reshape(KNOTS, KNOTS)


def main() -> None:
    albedos, scales, shears = lobes(make_squares())
    depths = np.sqrt(-np.log(np.clip(albedos, 1e-7, 1.0)))
    tables = [fit(depths, 2.0 * albedos * depths / (albedos + 0.02) + 1e-3)]
    for table in [*tables, *(fit(values, np.sqrt(albedos)) for values in (scales, shears))]:
        rows = ("{" + ", ".join(f"{value:.3f}f" for value in row) + "}," for row in table)
        sys.stdout.write("\n".join(rows) + "\n\n")


if __name__ == "__main__":
    main()
