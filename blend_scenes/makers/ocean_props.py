"""The objects in the sea: a lighthouse on rocks, a sailing boat, a buoy; and the tray round it."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import bpy
import numpy as np

from .shapes import Shape, box, joined, lathe, shape, tube
from .stage import bevel, make_collection, make_mesh, make_profile, paint, place, repeat, spin, subdivide

HALF, DEPTH = 4.0, 1.5  # of the block of water, metres
ROCK = (1.75, 1.35)


def build_boat() -> Any:
    """A sailing dinghy: a hull of cross-sections, mast, two sails that belly, a pennant."""
    fleet = make_collection("Boat")
    hull_paints = [paint("Hull", (0.66, 0.09, 0.06), 0.4), paint("Deck", (0.56, 0.36, 0.18), 0.6)]
    boat = place("Boat", make_mesh("Hull", hull(), hull_paints, 40.0), fleet, turn=(0.0, 0.0, 205.0))
    bevel(boat, 0.012, 2)
    mast = joined(
        [tube([(0.12, 0, 0.1), (0.12, 0, 1.75)], [0.03, 0.018], 8), tube([(0.12, 0, 0.42), (-0.72, 0, 0.4)], 0.018, 6)]
    )
    place("Mast", make_mesh("Mast", mast, [bpy.data.materials["Deck"]]), fleet, parent=boat)
    canvas = paint("Canvas", (0.82, 0.77, 0.66), 0.85)
    main = sail((0.10, 0.48), (-0.70, 0.45), (0.11, 1.68), 0.16)
    jib = sail((0.72, 0.27), (0.17, 0.34), (0.13, 1.45), 0.10)
    for name, form in (("Main sail", main), ("Jib", jib)):
        item = place(name, make_mesh(name, form, [canvas], 180.0), fleet, parent=boat)
        subdivide(item, 1)
    pennant = shape([(0.12, 0, 1.74), (0.12, 0, 1.88), (-0.2, 0.05, 1.81)], [(0, 1, 2)])
    place("Pennant", make_mesh("Pennant", pennant, [bpy.data.materials["Hull"]]), fleet, parent=boat)
    return boat


def hull() -> Shape:
    """Sections along X from stern to bow; slots: hull, deck."""
    rows = []
    for x, half, keel, sheer in (
        (-0.75, 0.22, -0.02, 0.26),
        (-0.4, 0.30, -0.12, 0.22),
        (0.0, 0.32, -0.16, 0.20),
        (0.4, 0.24, -0.13, 0.23),
        (0.7, 0.1, -0.04, 0.29),
        (0.86, 0.012, 0.1, 0.33),
    ):
        rows.append(
            [
                (x, -half, sheer),
                (x, -half * 0.8, sheer * 0.3 + keel * 0.7),
                (x, 0.0, keel),
                (x, half * 0.8, sheer * 0.3 + keel * 0.7),
                (x, half, sheer),
            ]
        )
    count = 5
    faces = [
        (r * count + c, r * count + c + 1, (r + 1) * count + c + 1, (r + 1) * count + c)
        for r in range(5)
        for c in range(4)
    ]
    skin = shape(np.array(rows).reshape(-1, 3), [face[::-1] for face in faces] + [tuple(range(count))])
    deck_points = [
        (x, side * half * 0.93, sheer - 0.05)
        for x, half, sheer in (
            (-0.75, 0.22, 0.26),
            (-0.4, 0.30, 0.22),
            (0.0, 0.32, 0.20),
            (0.4, 0.24, 0.23),
            (0.7, 0.1, 0.29),
            (0.86, 0.012, 0.33),
        )
        for side in (-1, 1)
    ]
    deck = shape(deck_points, [(2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1) for k in range(5)]).painted(1)
    rail = [tube([row[end] for row in rows], 0.022, 6).painted(1) for end in (0, 4)]
    return joined([skin, deck, *rail])


def sail(tack: tuple[float, float], clew: tuple[float, float], head: tuple[float, float], belly: float) -> Shape:
    """A triangle in XZ between three corners, blown out along Y; its top row closes to a strip of triangles."""
    cells = 6
    corners = [np.array(corner) for corner in (tack, clew, head)]
    vertices: list[tuple[float, float, float]] = []
    rows: list[list[int]] = []
    for r in range(cells + 1):
        up = r / cells
        row = []
        for c in range(cells + 1 - r):
            along = c / max(1, cells - r)
            x, z = (corners[0] + (corners[1] - corners[0]) * along) * (1 - up) + corners[2] * up
            row.append(len(vertices))
            vertices.append((x, belly * 4.0 * along * (1 - along) * (1 - up) * (0.45 + up), z))
        rows.append(row)
    faces = []
    for low, high in pairwise(rows):
        faces += [(low[c], low[c + 1], high[c]) for c in range(len(high))]
        faces += [(low[c + 1], high[c + 1], high[c]) for c in range(len(high) - 1)]
    return shape(vertices, faces)


def build_buoy() -> Any:
    fleet = bpy.data.collections["Boat"]
    profile = [
        (0.0, -0.14),
        (0.16, -0.08),
        (0.2, 0.04),
        (0.17, 0.12),
        (0.06, 0.16),
        (0.05, 0.44),
        (0.09, 0.46),
        (0.0, 0.56),
    ]
    buoy = place(
        "Buoy", make_profile("Buoy", profile, paint("Buoy", (0.80, 0.42, 0.04), 0.4)), fleet, turn=(0.0, 0.0, 10.0)
    )
    spin(buoy, 20)
    return buoy


def build_lighthouse(random: np.random.Generator) -> None:
    shore = make_collection("Lighthouse")
    stone = paint("Rock", (0.27, 0.245, 0.225), 0.95)
    for number, (dx, dy, size) in enumerate(
        (
            (0.0, 0.0, 1.15),
            (-0.75, -0.5, 0.6),
            (0.65, -0.6, 0.62),
            (0.55, 0.75, 0.7),
            (-0.8, 0.45, 0.55),
            (-0.15, -1.0, 0.42),
        )
    ):
        rough = rock(random)
        at = (ROCK[0] + dx, ROCK[1] + dy, -0.28)
        item = place(
            f"Rock {number}", make_mesh(f"Rock {number}", rough, [stone], 45.0), shore, at, (0, 0, 70.0 * number), size
        )
        bevel(item, 0.05, 2, 20.0)
    white, red = paint("Whitewash", (0.80, 0.78, 0.73)), paint("Red band", (0.62, 0.07, 0.05))
    base = np.array([*ROCK, 0.42])
    bands = [(0.46, 0.0), (0.43, 0.56), (0.395, 1.12), (0.36, 1.68), (0.33, 2.24)]
    for number, (low, high) in enumerate(pairwise(bands)):
        mesh = make_profile(f"Tower {number}", [low, high], red if number % 2 else white)
        spin(place(f"Tower {number}", mesh, shore, base), 32)
    gallery = [(0.3, 2.18), (0.5, 2.26), (0.5, 2.34), (0.28, 2.34)]
    iron = paint("Iron", (0.06, 0.065, 0.07), 0.4)
    spin(place("Gallery", make_profile("Gallery", gallery, iron), shore, base), 32)
    roof = [(0.36, 2.84), (0.34, 2.88), (0.12, 3.1), (0.05, 3.14), (0.06, 3.2), (0.0, 3.26)]
    spin(place("Cap", make_profile("Cap", roof, red), shore, base), 32)
    glass = [(0.22, 2.34), (0.22, 2.84)]
    spin(
        place(
            "Lantern",
            make_profile("Lantern", glass, paint("Light", (0.95, 0.78, 0.35), 0.3, emission=4.0)),
            shore,
            base,
        ),
        16,
    )
    bar = make_mesh("Bar", box((0.465, -0.012, 2.34), (0.485, 0.012, 2.6)), [iron])
    for k in range(14):
        place(f"Bar {k}", bar, shore, base, (0.0, 0.0, 360.0 * k / 14))
    ring = [(0.463, 2.59), (0.487, 2.59), (0.487, 2.615), (0.463, 2.615), (0.463, 2.59)]
    spin(place("Rail", make_profile("Rail", ring, iron), shore, base), 32)
    way_in = joined([box((-0.12, -0.47, 0.0), (0.12, -0.4, 0.42)), box((-0.06, -0.43, 1.25), (0.06, -0.36, 1.45))])
    place("Door", make_mesh("Door", way_in, [iron]), shore, base, (0.0, 0.0, -25.0))


def rock(random: np.random.Generator) -> Shape:
    """A lump: a coarse lathe with every point pushed about, flat-faced."""
    lump = lathe([(0.0, -0.8), (0.8, -0.6), (1.0, 0.0), (0.82, 0.42), (0.45, 0.62), (0.0, 0.66)], 9)
    return shape(lump.vertices * random.uniform(0.82, 1.12, (len(lump.vertices), 1)), lump.faces)


def build_tray() -> None:
    """The wooden tray round the block, the table, and a brass plate."""
    room = make_collection("Room")
    wood = paint("Tray", (0.30, 0.16, 0.075), 0.5)
    edge, lip = HALF + 0.02, -DEPTH * 0.62
    rim = make_mesh("Rim", box((-edge - 0.25, -edge - 0.25, -DEPTH - 0.22), (edge, -edge, lip)), [wood])
    for k in range(4):
        bevel(place(f"Rim {k}", rim, room, turn=(0.0, 0.0, 90.0 * k)), 0.04, 3)
    base = box((-edge, -edge, -DEPTH - 0.2), (edge, edge, -DEPTH - 0.02))
    place("Tray", make_mesh("Tray", base, [wood]), room)
    plank = make_mesh(
        "Table plank",
        box((-12.0, 0.0, -DEPTH - 0.42), (12.0, 1.28, -DEPTH - 0.22)),
        [paint("Table", (0.50, 0.40, 0.29), 0.6)],
    )
    table = place("Table", plank, room, (0.0, -9.0, 0.0))
    bevel(table, 0.02, 2)
    repeat(table, 16, (0.0, 1.3, 0.0))
