"""The land round the tree: a hill with grass, stones and a fence."""

from __future__ import annotations

from itertools import pairwise
from math import cos, pi, sin
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from .shapes import Points, box, grid, joined, shape
from .stage import bevel, make_collection, make_mesh, paint, place, subdivide


def hill_height(x: Points, y: Points) -> Points:
    """The ground's height: a knoll under the tree, and swells beyond it."""
    knoll = 0.9 * np.exp(-(x * x + y * y) / 22.0) - 0.9
    swells = 0.35 * np.sin(0.22 * x + 0.6) * np.sin(0.18 * y + 0.3) + 0.035 * np.maximum(0.0, y - 4.0)
    return knoll + swells * (1.0 - np.exp(-(x * x + y * y) / 30.0))


def build_hill(random: np.random.Generator) -> None:
    land = make_collection("Land")
    sheet = grid(28, 28, 70.0, 70.0)
    x, y = sheet.vertices[:, 0], sheet.vertices[:, 1]
    bent = np.sign(x) * np.abs(x / 35.0) ** 1.6 * 35.0, np.sign(y) * np.abs(y / 35.0) ** 1.6 * 35.0
    hill = shape(np.column_stack([*bent, hill_height(*bent)]), sheet.faces)
    ground = place("Hill", make_mesh("Hill", hill, [paint("Grass", (0.25, 0.33, 0.09), 0.95)], 180.0), land)
    subdivide(ground, 1)
    build_grass(land, random)
    build_fence(land)
    stone_paint = paint("Stone", (0.40, 0.38, 0.35), 0.9)
    for number in range(9):
        angle, reach = random.uniform(0.0, 2.0 * pi), random.uniform(1.3, 5.0)
        at = np.array([reach * cos(angle), reach * sin(angle)])
        rough = box((-0.5, -0.4, -0.3), (0.5, 0.4, 0.3))
        rough = shape(rough.vertices + random.normal(0.0, 0.09, (8, 3)), rough.faces)
        size = random.uniform(0.15, 0.42)
        where = (*at, float(hill_height(*at)) + size * 0.1)
        stone = place(
            f"Stone {number}",
            make_mesh(f"Stone {number}", rough, [stone_paint], 180.0),
            land,
            where,
            (0, 0, 57 * angle),
            size,
        )
        subdivide(stone, 2)


def build_grass(land: Any, random: np.random.Generator) -> None:
    """Tufts as instances on loose points of the ground, near the camera's side."""
    blades = []
    for _ in range(12):
        half, high = 0.012, random.uniform(0.12, 0.3)
        lean = random.normal(0.06, 0.07)
        foot = random.normal(0.0, 0.05, 2)
        bend = [
            (-half, 0.0, 0.0),
            (half, 0.0, 0.0),
            (half * 0.7 + lean * 0.4, 0.0, high * 0.6),
            (-half * 0.7 + lean * 0.4, 0.0, high * 0.6),
            (lean, 0.0, high),
        ]
        blades.append(shape(bend, [(0, 1, 2, 3), (3, 2, 4)]).turned_z(random.normal(0.0, 0.6)).moved(*foot))
    tuft = make_mesh("Tuft", joined(blades), [paint("Blades", (0.36, 0.40, 0.10), 0.9)], 180.0)
    spots = random.uniform((-13.0, -11.0), (13.0, 9.0), (800, 2))
    points = np.column_stack([spots, hill_height(spots[:, 0], spots[:, 1]) - 0.01])
    cloud = bpy.data.meshes.new("Grass points")
    cloud.from_pydata(points, [], [])
    field_ = place("Grass", cloud, land)
    field_.instance_type = "VERTS"
    field_.show_instancer_for_render = field_.show_instancer_for_viewport = False
    place("Tuft", tuft, land, parent=field_)


def build_fence(land: Any) -> None:
    """A fence of rails that runs along the hill behind the tree."""
    wood = paint("Fence", (0.34, 0.29, 0.23), 0.9)
    post = make_mesh("Post", box((-0.07, -0.07, -0.4), (0.07, 0.07, 1.05)), [wood])
    rail = make_mesh("Rail", box((0.0, -0.03, -0.05), (1.0, 0.03, 0.05)), [wood])
    xs = np.arange(-14.0, 14.1, 2.0)
    ys = 4.4 + 0.02 * xs * xs + 0.1 * xs
    spots = [Vector((x, y, float(hill_height(x, y)))) for x, y in zip(xs, ys, strict=True)]
    for number, spot in enumerate(spots):
        bevel(place(f"Post {number}", post, land, spot), 0.015, 1)
    for number, (start, end) in enumerate(pairwise(spots)):
        turn = (end - start).to_track_quat("X", "Z").to_euler()
        for high in (0.45, 0.85):
            item = place(
                f"Rail {number} {high:g}",
                rail,
                land,
                start + Vector((0.0, -0.08, high)),
                size=((end - start).length, 1.0, 1.0),
            )
            item.rotation_euler = turn
