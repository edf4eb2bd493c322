"""A quarter of a town: houses round a courtyard, streets, a square with a tower; walls in small faces, for baked rays.

X is east, Y is north, lengths are metres. Each house is a box with windows and a pitched roof, front to the street.
"""

from __future__ import annotations

from itertools import pairwise
from math import pi
from typing import Any

import numpy as np

from .shapes import Shape, ball, box, grid, joined, lathe, shape
from .stage import add_camera, add_light, light_world, make_collection, make_mesh, open_stage, paint, place

BLOCK, STREET, DEPTH = 52.0, 13.0, 11.0  # of a block's sides, between blocks, of a house
PITCH = BLOCK + STREET
FLOOR, BAY, CELL = 3.3, 2.9, 2.2  # of storeys, from window to window, of faces without windows
EAVES, SLOPE = 0.5, 0.85
WALLS, WINDOW, ROOF = 6, 6, 7  # material slots: the first six are plasters
SQUARE = (1, 0)  # the block that is a square with a tower instead


def make() -> None:
    open_stage("Town", exposure=0.2)
    random = np.random.default_rng(40)
    plasters = ((0.80, 0.70, 0.52), (0.72, 0.47, 0.33), (0.83, 0.79, 0.72), (0.62, 0.66, 0.58), (0.75, 0.59, 0.45))
    paints = [paint(f"Plaster {row}", colour) for row, colour in enumerate((*plasters, (0.58, 0.60, 0.66)))]
    paints += [paint("Glass", (0.05, 0.08, 0.11), 0.15), paint("Tiles", (0.42, 0.13, 0.07), 0.6)]
    street, lawn, bark, leaves = (
        paint(name, colour, 0.9)
        for name, colour in (
            ("Paving", (0.33, 0.32, 0.31)),
            ("Lawn", (0.13, 0.25, 0.06)),
            ("Bark", (0.13, 0.085, 0.06)),
            ("Leaves", (0.09, 0.20, 0.045)),
        )
    )
    town = make_collection("Town")
    for column in (-1, 0, 1):
        for row in (-1, 0, 1):
            middle = (column * PITCH, row * PITCH, 0.0)
            if (column, row) == SQUARE:
                place("Tower", make_mesh("Tower", snapped(tower()), paints, None), town, middle)
                continue
            is_middle = column == row == 0
            name = "Courtyard houses" if is_middle else f"Block {'SMN'[row + 1]}{'WME'[column + 1]}"
            place(name, make_mesh(name, snapped(block(random, is_middle)), paints, None), town, middle)
    place("Streets", make_mesh("Streets", streets(), [street], None), town)
    court = BLOCK - 2 * DEPTH
    place("Court", make_mesh("Court", grid(25, 25, court, court).moved(0.0, 0.0, 0.05), [lawn], None), town)
    plant_trees(random, town, [bark, leaves])
    light_world((0.45, 0.62, 0.92), 0.22)
    add_light("SUN", "Sun", (50.0, -22.0, 42.0), (0.0, 0.0, 0.0), 4.5, (1.0, 0.90, 0.76), 0.53)
    add_camera((-58.0, -122.0, 100.0), (9.0, -5.0, 4.0), 33.0, 600.0)


def snapped(form: Shape) -> Shape:
    """The same shape with positions in steps of a 32nd of a metre, which files compress well."""
    return Shape(np.round(form.vertices * 32.0) / 32.0, form.faces, form.slots)


def sheet(xs: Any, zs: Any, slots: Any) -> Shape:
    """Faces in X and Z that look to -Y. slots: (rows, columns)."""
    columns, rows = len(xs), len(zs)
    vertices = [(x, 0.0, z) for z in zs for x in xs]
    corners = [(r * columns + c, r * columns + c + 1) for r in range(rows - 1) for c in range(columns - 1)]
    made = shape(vertices, [(a, b, b + columns, a + columns) for a, b in corners])
    return Shape(made.vertices, made.faces, [int(slot) for slot in np.ravel(slots)])


def streets() -> Shape:
    """The ground but for what is below houses and the court: a face below a house would have neither sun nor sky."""
    ends = [middle + side for middle in (-PITCH, 0.0, PITCH) for side in (-BLOCK / 2, DEPTH - BLOCK / 2)]
    ends = sorted([-PITCH - BLOCK / 2 - STREET, *ends, *(-end for end in ends), PITCH + BLOCK / 2 + STREET])
    lines = np.unique([low + step for low, high in pairwise(ends) for step in steps(high - low, 4.0)])
    ground = sheet(lines, lines, np.zeros((len(lines) - 1, len(lines) - 1))).turned_x(-pi / 2)
    middles = ground.vertices[np.array(ground.faces)].mean(axis=1)[:, :2]
    blocks = np.round(middles / PITCH)
    within = np.abs(middles - blocks * PITCH).max(axis=1)
    is_open = (within > BLOCK / 2) | (blocks == SQUARE).all(axis=1)
    is_open |= (within < BLOCK / 2 - DEPTH) & (blocks != 0.0).any(axis=1)
    used, faces = np.unique(np.array(ground.faces)[is_open], return_inverse=True)
    return shape(ground.vertices[used], faces.reshape(-1, 4))


def facade(width: float, floors: int, plaster: int, bay: float) -> Shape:
    """A wall with a window in each bay of each storey."""
    bays = max(1, round(width / bay))
    starts = np.arange(bays) * width / bays
    xs = np.unique(np.round([0.0, width, *(starts + 0.3 * width / bays), *(starts + 0.7 * width / bays)], 3))
    zs = np.array([0.0, *(floor * FLOOR + height for floor in range(floors) for height in (0.9, 2.5)), floors * FLOOR])
    slots = np.full((len(zs) - 1, len(xs) - 1), plaster)
    slots[1::2, 1::2] = WINDOW
    return sheet(xs, zs, slots)


def steps(length: float, cell: float) -> Any:
    """Even places from 0 to a length."""
    return np.linspace(0.0, length, max(1, round(length / cell)) + 1)


def gable(depth: float, floors: int, plaster: int, cell: float) -> Shape:
    """The end wall, up to the ridge."""
    ys = np.linspace(0.0, depth, 2 * max(2, round(depth / cell / 2)) + 1)
    low = sheet(ys, steps(floors * FLOOR, cell), np.full((len(steps(floors * FLOOR, cell)) - 1, len(ys) - 1), plaster))
    tops = floors * FLOOR + SLOPE * (depth / 2 - np.abs(ys - depth / 2))
    eaves = floors * FLOOR
    outline = [(y, 0.0, top) for y, top in zip(ys, tops, strict=True)]
    base = [(y, 0.0, eaves) for y in ys]
    last = len(ys) - 1
    faces = [(0, 1, last + 2), (last - 1, last, 2 * last)]
    faces += [(k, k + 1, last + 2 + k, last + 1 + k) for k in range(1, last - 1)]
    return joined([low, shape(base + outline, faces, plaster)])


def house(width: float, floors: int, plaster: int, bay: float, cell: float) -> Shape:
    """From x = 0 to width, its front at y = 0."""
    height, half = floors * FLOOR, DEPTH / 2
    front = facade(width, floors, plaster, bay)
    end = gable(DEPTH, floors, plaster, cell)
    reach = half + EAVES
    xs, lengths = steps(width, cell), steps(reach, cell)
    slope = sheet(xs, lengths, np.full((len(lengths) - 1, len(xs) - 1), ROOF))
    up = slope.vertices.copy()
    up[:, 1], up[:, 2] = slope.vertices[:, 2] - EAVES, height + SLOPE * (slope.vertices[:, 2] - EAVES) + 0.02
    roof = Shape(up, slope.faces, slope.slots)
    around = [part.turned_z(pi).moved(width, DEPTH) for part in (front, roof)]
    ends = [end.turned_z(-pi / 2).moved(0.0, DEPTH), end.turned_z(pi / 2).moved(width, 0.0)]
    return joined([front, roof, *around, *ends])


def block(random: np.random.Generator, is_fine: bool) -> Shape:
    """Rows of houses along four streets, round a courtyard; the middle of the block is the origin."""
    bay, cell = (BAY, CELL) if is_fine else (2.4 * BAY, 3 * CELL)
    half, parts = BLOCK / 2, []
    for turn, length in ((0, BLOCK), (1, BLOCK - 2 * DEPTH), (2, BLOCK), (3, BLOCK - 2 * DEPTH)):
        count = 4 if length == BLOCK else 2
        cuts = np.array([0.0, *(np.arange(1, count) + random.uniform(-0.15, 0.15, count - 1)), count]) * length / count
        for start, end in pairwise(cuts):
            low = 3 if is_fine and turn else 2  # the sun reaches the court over lower houses in the south
            built = house(end - start, int(random.integers(low, low + 3)), int(random.integers(WALLS)), bay, cell)
            parts.append(built.moved(start - length / 2, -half).turned_z(turn * pi / 2))
    return joined(parts)


def tower() -> Shape:
    """A bell tower of four walls with a pointed roof, and a low hall."""
    sides = [
        sheet(steps(8.0, 2.0), steps(30.0, 2.0), np.full((15, 4), 2)).moved(-4.0, -4.0).turned_z(turn * pi / 2)
        for turn in range(4)
    ]
    spire = lathe([(6.2, 30.0), (0.0, 42.0)], 4, pi / 4).painted(ROOF)
    hall = house(20.0, 2, 2, BAY, CELL).moved(4.0, -DEPTH / 2)
    return joined([*sides, spire, hall])


def plant_trees(random: np.random.Generator, collection: Any, materials: list[Any]) -> None:
    """Trees in the court and on the square, as one mesh."""
    square = np.array(SQUARE) * PITCH
    places = [(-7.0, 6.0), (8.5, 3.0), (-4.0, -8.5), (6.0, -7.0)]
    places += [(square[0] + x, square[1] + y) for x in (-20.0, -10.0, 0.0, 10.0, 20.0) for y in (-20.0, 20.0)]
    parts = []
    for x, y in places:
        height, radius = random.uniform(3.0, 4.2), random.uniform(1.9, 2.7)
        crown = ball((0.0, 0.0, height + 0.6 * radius), radius * np.array([1.0, 1.0, 1.15]), 6, 8)
        rough = Shape(crown.vertices + random.normal(0.0, 0.12, crown.vertices.shape), crown.faces, crown.slots)
        trunk = box((-0.16, -0.16, 0.0), (0.16, 0.16, height)).painted(0)
        parts.append(joined([trunk, rough.painted(1)]).moved(x, y))
    place("Trees", make_mesh("Trees", snapped(joined(parts)), materials, None), collection)
