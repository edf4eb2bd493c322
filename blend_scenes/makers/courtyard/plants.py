"""Plants as collections to instance: leaves sit on the vertices or faces of emitters that are not shown themselves."""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

import bpy
import numpy as np

from ..shapes import Points, Shape, box, joined, lathe, shape, tube
from ..stage import bevel, instance, make_collection, make_curve, make_mesh, make_profile, place, spin, subdivide
from .palette import Palette


def leaf(length: float, width: float) -> Shape:
    """A folded leaf along +Y, of two triangles."""
    rise = width * 0.25
    corners = [
        (0.0, 0.0, 0.0),
        (width / 2, length * 0.45, rise),
        (0.0, length, -rise),
        (-width / 2, length * 0.45, rise),
    ]
    return shape(corners, [(0, 1, 2), (0, 2, 3)])


def cluster(random: np.random.Generator, count: int, length: float, width: float, spread: float) -> Shape:
    """Leaves from one point, round +Y within `spread` radians."""
    leaves = []
    for _ in range(count):
        blade = leaf(length * random.uniform(0.7, 1.15), width).turned_y(random.uniform(-pi, pi))
        tilt = spread * np.sqrt(random.random())
        leaves.append(blade.turned_x(tilt).turned_y(random.uniform(-pi, pi)).painted(int(random.random() < 0.35)))
    return joined(leaves)


def ellipsoid_points(random: np.random.Generator, count: int, radii: tuple[float, float, float]) -> Points:
    """(count, 3) points evenly over an ellipsoid's skin, a little inside or out."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    turn = pi * (1.0 + 5.0**0.5) * k
    flat = np.sqrt(1.0 - z * z)
    ball = np.column_stack([np.cos(turn) * flat, np.sin(turn) * flat, z])
    return ball * random.normal(0.92, 0.1, (count, 1)) * np.asarray(radii)


def on_vertices(name: str, points: Points, mesh: Any, collection: Any, at: tuple[float, float, float]) -> Any:
    """Instances of a mesh on loose points, its +Y away from the emitter's origin."""
    cloud = bpy.data.meshes.new(f"{name} points")
    cloud.from_pydata(points, [], [])
    emitter = place(name, cloud, collection, at)
    emitter.instance_type = "VERTS"
    emitter.use_instance_vertices_rotation = True
    return carry(emitter, name, mesh, collection)


def on_faces(name: str, faces: Shape, mesh: Any, collection: Any, at: tuple[float, float, float]) -> Any:
    """Instances of a mesh on an emitter's faces, as large as these and with its +Z out of them."""
    skin = bpy.data.meshes.new(f"{name} faces")
    skin.from_pydata(faces.vertices, [], faces.faces)
    emitter = place(name, skin, collection, at)
    emitter.instance_type = "FACES"
    emitter.use_instance_faces_scale = True
    return carry(emitter, name, mesh, collection)


def carry(emitter: Any, name: str, mesh: Any, collection: Any) -> Any:
    emitter.show_instancer_for_render = emitter.show_instancer_for_viewport = False
    place(f"{name} leaf", mesh, collection, parent=emitter)
    return emitter


def make_plants(palette: Palette, random: np.random.Generator) -> dict[str, Any]:
    """The collections, by name; no one is in the scene but through its instances."""
    return {
        "lemon": lemon_tree(palette, random),
        "agave": agave(palette, random),
        "lavender": lavender(palette, random),
        "cypress": cypress(palette, random),
        "window box": window_box(palette, random),
    }


def place_pot(plant: Any, palette: Palette, height: float, radius: float) -> None:
    """A terracotta pot with a rolled rim, and soil in it."""
    profile = [(0.0, 0.0), (radius * 0.66, 0.0), (radius * 0.72, 0.05 * height), (radius * 0.92, 0.72 * height)]
    profile += [(radius * 0.94, 0.8 * height), (radius * 1.06, 0.84 * height), (radius * 1.08, 0.96 * height)]
    profile += [(radius * 1.02, height), (radius * 0.92, 0.98 * height), (radius * 0.88, 0.88 * height)]
    name = f"Pot {height:g}"
    spin(place(name, make_profile(name, profile, palette["terracotta"]), plant), 24, 50.0)
    soil = [(radius * 0.9, 0.9 * height), (0.0, 0.93 * height)]
    spin(place(f"Soil {height:g}", make_profile(f"Soil {height:g}", soil, palette["soil"]), plant), 24)


def lemon_tree(palette: Palette, random: np.random.Generator) -> Any:
    plant = make_collection("Lemon tree", instanced=True)
    place_pot(plant, palette, 0.55, 0.34)
    trunk = tube(
        [(0, 0, 0.45), (0.02, 0.01, 0.8), (-0.02, 0.02, 1.15), (0.0, 0.0, 1.5)], [0.045, 0.035, 0.035, 0.02], 8
    )
    place("Lemon trunk", make_mesh("Lemon trunk", trunk, [palette["bark"]]), plant)
    tuft = make_mesh(
        "Lemon tuft", cluster(random, 11, 0.15, 0.065, 1.25), [palette["leaf"], palette["leaf light"]], None
    )
    centre = (0.0, 0.0, 1.68)
    on_vertices("Lemon crown", ellipsoid_points(random, 120, (0.52, 0.52, 0.48)), tuft, plant, centre)
    fruit = lathe(
        [(0.0, -0.05), (0.02, -0.042), (0.037, -0.02), (0.04, 0.0), (0.037, 0.02), (0.02, 0.042), (0.0, 0.055)], 8
    )
    mesh = make_mesh("Lemon", fruit, [palette["lemon"]], 180.0)
    on_vertices("Lemons", ellipsoid_points(random, 16, (0.56, 0.56, 0.5)), mesh, plant, centre)
    return plant


def agave(palette: Palette, random: np.random.Generator) -> Any:
    """A rosette of thick pointed leaves in a low pot."""
    plant = make_collection("Agave", instanced=True)
    place_pot(plant, palette, 0.42, 0.36)
    blades = []
    for k in range(22):
        steep = 0.25 + 0.95 * (k / 21.0)
        length = 0.5 + 0.25 * sin(pi * k / 21.0)
        rows = []
        for t in np.linspace(0.0, 1.0, 6):
            bend = steep + 0.55 * t * t * (1.0 - k / 40.0)
            half = 0.055 * (1.0 - t) ** 0.6 * (0.75 + 0.9 * t) + 0.002
            out, up = length * t * sin(bend), length * t * cos(bend)
            rows += [(out, -half, up + half * 0.5), (out, 0.0, up), (out, half, up + half * 0.5)]
        quads = [(3 * r + c, 3 * r + c + 3, 3 * r + c + 4, 3 * r + c + 1) for r in range(5) for c in range(2)]
        blades.append(shape(rows, quads).turned_z(2.39996 * k + random.normal(0.0, 0.1)))
    item = place(
        "Agave leaves", make_mesh("Agave leaves", joined(blades), [palette["agave"]], 180.0), plant, (0, 0, 0.38)
    )
    subdivide(item, 1)
    return plant


def lavender(palette: Palette, random: np.random.Generator) -> Any:
    plant = make_collection("Lavender", instanced=True)
    place_pot(plant, palette, 0.36, 0.26)
    stalk = joined(
        [
            lathe([(0.006, 0.0), (0.004, 0.3)], 3),
            lathe([(0.0, 0.27), (0.016, 0.3), (0.02, 0.34), (0.012, 0.4), (0.0, 0.43)], 5).painted(1),
        ]
    ).turned_x(-pi / 2)
    mesh = make_mesh("Lavender stalk", stalk, [palette["agave"], palette["lavender"]], 180.0)
    points = ellipsoid_points(random, 150, (0.16, 0.16, 0.2))
    on_vertices("Lavender stalks", points[points[:, 2] > 0.03], mesh, plant, (0.0, 0.0, 0.3))
    return plant


def cypress(palette: Palette, random: np.random.Generator) -> Any:
    plant = make_collection("Cypress", instanced=True)
    trunk = tube([(0, 0, 0), (0, 0, 2.0), (0, 0, 6.0)], [0.16, 0.13, 0.02], 8)
    place("Cypress trunk", make_mesh("Cypress trunk", trunk, [palette["bark"]]), plant)
    points = ellipsoid_points(random, 340, (0.85, 0.85, 3.6))
    points[:, :2] *= (0.62 - 0.105 * points[:, 2:3]).clip(0.15, 1.0) + 0.12
    tuft = make_mesh(
        "Cypress tuft", cluster(random, 14, 0.42, 0.13, 0.8), [palette["leaf dark"], palette["leaf"]], None
    )
    on_vertices("Cypress leaves", points, tuft, plant, (0.0, 0.0, 3.9))
    return plant


def window_box(palette: Palette, random: np.random.Generator) -> Any:
    """Geraniums in a box, to hang below a window."""
    plant = make_collection("Window box", instanced=True)
    case = box((-0.45, -0.26, 0.0), (0.45, -0.02, 0.2))
    bevel(place("Box", make_mesh("Box", case, [palette["terracotta"]]), plant), 0.012)
    tuft = make_mesh(
        "Geranium tuft", cluster(random, 8, 0.09, 0.07, 1.3), [palette["leaf"], palette["leaf light"]], None
    )
    bloom = make_mesh("Geranium bloom", cluster(random, 10, 0.045, 0.05, 1.5), [palette["cloth"]] * 2, None)
    points = random.normal(0.0, 1.0, (44, 3)) * (0.19, 0.05, 0.045) + np.array([0.0, 0.0, 0.07])
    on_vertices("Geranium leaves", points, tuft, plant, (0.0, -0.15, 0.19))
    blooms = random.normal(0.0, 1.0, (16, 3)) * (0.2, 0.05, 0.03) + np.array([0.0, -0.03, 0.17])
    on_vertices("Geranium blooms", blooms, bloom, plant, (0.0, -0.15, 0.19))
    return plant


def build_climber(palette: Palette, random: np.random.Generator, x: float) -> None:
    """Bougainvillea that pours over the garden wall: stems as a curve, leaves and bracts on scattered faces."""
    garden = make_collection("Climber")
    stems = []
    for k in range(5):
        y = -6.0 + 0.4 * k
        top = [
            (x - 0.1, y + 0.3, 2.2),
            (x - 0.12, y + 0.6, 3.15),
            (x - 0.2, y + 2.0 + 0.4 * k, 3.3),
            (x - 0.3, y + 3.2, 2.8),
        ]
        stems.append([(x - 0.12, -5.6 + 0.06 * k, 0.0), (x - 0.1, -5.5 + 0.1 * k, 1.2), *top])
    place("Stems", make_curve("Stems", stems, 0.02, palette["bark"], 1), garden)
    leaves = cluster(random, 7, 1.1, 0.55, 1.2).turned_x(pi / 2)
    bracts = cluster(random, 9, 0.9, 0.75, 1.2).turned_x(pi / 2)
    green = make_mesh("Climber leaves", leaves, [palette["leaf"], palette["leaf light"]], None)
    pink = make_mesh("Climber bracts", bracts, [palette["bougainvillea"]] * 2, None)
    on_faces("Leaves", hanging_faces(random, 300, 0.17), green, garden, (x, -4.0, 3.15))
    on_faces("Bracts", hanging_faces(random, 360, 0.15), pink, garden, (x - 0.05, -4.0, 3.17))


def hanging_faces(random: np.random.Generator, count: int, size: float) -> Shape:
    """Small squares over a wall's coping and down its front (-X), denser at the top, in four cascades."""
    squares = []
    for _ in range(count):
        lobe = random.choice([-2.6, -1.1, 0.4, 2.1])
        y = random.normal(lobe, 0.55)
        reach = 1.5 * np.exp(-(((y - lobe) / 0.6) ** 2)) + 0.35
        drop = reach * random.random() ** 1.6
        out = 0.16 + 0.22 * sin(pi * min(1.0, drop / reach + 0.15)) + random.normal(0.0, 0.05)
        at = (0.25 - random.random() * 0.3, y, 0.18 + random.normal(0.0, 0.06))
        if random.random() < 0.78:
            at = (-out, y, 0.2 - drop)
        half = size * random.uniform(0.6, 1.2) / 2
        flat = shape([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [(0, 1, 2, 3)])
        tilt = -pi / 2 if at[0] < 0 else -0.3
        squares.append(flat.turned_y(tilt + random.normal(0.0, 0.5)).turned_z(random.normal(0.0, 0.6)).moved(*at))
    return joined(squares)


def set_out_plants(plants: dict[str, Any], random: np.random.Generator) -> None:
    garden = make_collection("Plants")
    spots = [
        ("lemon", (-4.6, 4.6), 1.0), ("lemon", (4.1, 4.7), 1.08), ("lemon", (-4.75, -0.6), 1.05),
        ("agave", (-2.45, 5.05), 0.95), ("agave", (4.75, -2.75), 1.05), ("agave", (-4.75, 2.1), 0.9),
        ("lavender", (-3.9, 4.95), 1.0), ("lavender", (3.3, 5.0), 1.1), ("lavender", (4.4, -3.5), 1.1),
        ("lavender", (-4.9, -1.4), 1.15), ("lavender", (-4.45, -1.75), 0.95), ("lavender", (1.3, 5.05), 1.0),
    ]  # fmt: skip
    for number, (kind, (x, y), size) in enumerate(spots):
        spin = random.uniform(0.0, 360.0)
        instance(f"{kind.title()} {number}", plants[kind], garden, (x, y, 0.0), spin, size)
    trees = [
        (8.6, -0.6, 1.0),
        (8.9, 1.2, 1.12),
        (11.5, 4.5, 1.3),
        (12.5, 8.6, 1.45),
        (6.0, 13.0, 1.5),
        (8.2, 14.0, 1.35),
    ]
    for number, (x, y, size) in enumerate(trees):
        instance(f"Cypress {number}", plants["cypress"], garden, (x, y, -0.1), random.uniform(0.0, 360.0), size)
