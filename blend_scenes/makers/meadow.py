"""A sheep and her lamb on a meadow in the wind, under a tree of scanned points: hair curves and point clouds.

Nothing that is round is in the file: geometry nodes grow wool, grass and flowers as curves, and strew the points of
the tree. The one exception is the fringe of each sheep, a few curves that can be combed by hand.
"""

from __future__ import annotations

from math import atan2, hypot
from typing import Any

import bpy
import numpy as np

from .meadow_plants import build_flowers, build_lawn, build_tree, meadow_height
from .meadow_sheep import Build, build_sheep
from .shapes import grid, shape
from .stage import add_camera, add_light, light_world, make_collection, make_mesh, open_stage, paint, place

FRAMES = 48
SUN = (-5.0, -3.6, 4.4)


def make() -> None:
    scene = open_stage("Meadow", FRAMES)
    scene.cycles_curves.shape = "THICK"  # round, as the add-on shows them
    random = np.random.default_rng(52)
    build_land()
    wool = paint("Wool", (0.88, 0.82, 0.72), 0.95)
    herd = make_collection("Sheep")
    build_sheep(herd, random, wool, Build("Ewe"), (0.16, 0.0), 24.0)
    lamb = Build("Lamb", size=0.52, wool=0.62, head=1.32, density=4600.0)
    build_sheep(herd, random, wool, lamb, (-0.86, -0.62), -34.0)
    build_lawn()
    build_flowers()
    build_tree(random, (2.15, 3.4))
    light_sky()
    add_light("SUN", "Sun", SUN, (0.0, 0.0, 0.0), 3.9, (1.0, 0.86, 0.66), 1.2)
    add_camera((-0.55, -4.1, 0.55), (0.27, 0.0, 0.70), 33.0)


def light_sky() -> None:
    """A clear sky of single scattering, without a disc: the lamp is the sun."""
    light_world((0.42, 0.60, 0.90))
    nodes = bpy.context.scene.world.node_tree
    sky = nodes.nodes.new("ShaderNodeTexSky")
    sky.sky_type = "SINGLE_SCATTERING" if bpy.app.version >= (5, 0, 0) else "NISHITA"
    sky.sun_disc = False
    sky.sun_elevation = atan2(SUN[2], hypot(SUN[0], SUN[1]))
    sky.sun_rotation = atan2(SUN[0], SUN[1])
    nodes.links.new(sky.outputs[0], nodes.nodes["Background"].inputs["Color"])
    nodes.nodes["Background"].inputs["Strength"].default_value = 0.16


def build_land() -> Any:
    """The ground, which swells, and hills far away."""
    land = make_collection("Land")
    sheet = grid(36, 36, 60.0, 60.0)
    x, y = (np.sign(axis) * np.abs(axis / 30.0) ** 1.8 * 30.0 for axis in sheet.vertices[:, :2].T)
    soil = paint("Soil", (0.24, 0.34, 0.075), 0.95)
    form = shape(np.column_stack([x, y, meadow_height(x, y)]), sheet.faces)
    ground = place("Ground", make_mesh("Ground", form, [soil], 180.0), land)
    for number, (distance, height, colour) in enumerate(
        ((25.0, 2.3, (0.22, 0.33, 0.13)), (43.0, 5.0, (0.25, 0.37, 0.30)), (70.0, 10.0, (0.34, 0.47, 0.56)))
    ):
        place(f"Hills {number}", make_hills(f"Hills {number}", distance, height, colour, number), land)
    return ground


def make_hills(name: str, distance: float, height: float, colour: tuple[float, float, float], seed: int) -> Any:
    """A range of hills: a wall whose upper edge rises and falls."""
    across = np.linspace(-1.0, 1.0, 60)
    phases = np.random.default_rng(seed).uniform(0.0, 6.0, 4)
    waves = [
        np.sin(across * rate + phase) / rate**0.8 for rate, phase in zip((3.0, 7.0, 13.0, 29.0), phases, strict=True)
    ]
    tops = height * (0.72 + 0.55 * np.sum(waves, axis=0))
    x = across * distance * 1.3
    low = np.column_stack([x, np.full(60, distance), np.full(60, -3.0)])
    high = np.column_stack([x, distance + 0.4 * height + 0.0 * x, tops])
    faces = [(k, k + 1, 61 + k, 60 + k) for k in range(59)]
    return make_mesh(name, shape(np.concatenate([low, high]), faces), [paint(name, colour, 1.0)], 180.0)
