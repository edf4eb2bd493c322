"""The buildings round the court, which is 12.4 m square about the origin, and its paving.

The back wing is a collection along y = BAY_LINE; the left wing is the same collection turned by a quarter. The right
side is a garden wall with stairs up to a small house; a bell tower rises behind.
"""

from __future__ import annotations

from math import atan2, cos, degrees, hypot, pi, sin
from typing import Any

import numpy as np

from ..shapes import box, joined, lathe, prism, rounded, wall
from ..stage import bevel, instance, make_collection, make_curve, make_mesh, make_profile, place, repeat, solidify, spin
from .joinery import door, window_frame
from .palette import Palette
from .roofs import TILE_NAMES, TILE_PITCH, TILE_REACH, hip, ridge, tiled
from .wing import BAY_LINE, build_wing, build_wing_end


def build_architecture(palette: Palette, random: np.random.Generator) -> Any:
    """Builds it all. Returns the wing's collection, for other objects that belong to every wing."""
    house = make_collection("Architecture")
    wing = make_collection("Wing", instanced=True)
    build_wing(wing, palette, random)
    instance("Wing back", wing, house, (0.0, 0.0, 0.0))
    instance("Wing left", wing, house, (0.0, 0.0, 0.0), 90.0)
    build_wing_end(house, palette)
    build_paving(house, palette, random)
    build_tower(house, palette, random)
    build_garden_side(house, palette, random)
    return wing


def build_paving(house: Any, palette: Palette, random: np.random.Generator) -> None:
    """Slabs in a repeated pattern of four sizes, and a ring of wedges round the fountain."""
    materials = [palette[name] for name in ("paving warm", "paving cool", "paving light")]
    pattern = [(0, 0, 2, 2), (2, 0, 1, 1), (3, 0, 1, 2), (2, 1, 1, 1), (0, 2, 1, 2), (1, 2, 2, 1), (3, 2, 1, 1)]
    pattern += [(1, 3, 1, 1), (2, 3, 2, 1)]
    unit, gap = 0.52, 0.012
    slabs = []
    for across in range(3):
        for x, y, w, h in pattern:
            low = np.array([x + across * 4, y]) * unit + gap
            high = np.array([x + across * 4 + w, y + h]) * unit - gap
            top = float(random.normal(0.0, 0.004))
            slabs.append(box((*low, -0.08), (*high, top)).painted(int(random.choice([0, 0, 1, 2]))))
    item = place("Paving", make_mesh("Slabs", joined(slabs), materials), house, (-9.36, -14.56, 0.0))
    bevel(item, 0.014, 1)
    repeat(item, 3, (12 * unit, 0.0, 0.0))
    repeat(item, 10, (0.0, 4 * unit, 0.0)).name = "Array along"
    ground = box((-30.0, -30.0, -0.3), (30.0, 30.0, -0.035))
    place("Ground", make_mesh("Ground", ground, [palette["stone dark"]]), house)


def build_tower(house: Any, palette: Palette, random: np.random.Generator) -> None:
    """The bell tower behind the corner of the two wings."""
    half, top, rise = 1.6, 10.4, 1.5
    tower = place("Tower", None, house, (-4.9, 11.6, 0.0))
    openings = [(half - 0.5, half + 0.5, 8.3, 9.7)]
    # Each face ends at the next one's back, like the sails of a windmill: no two lie in one plane.
    face = wall(2 * half - 0.35, top, 0.35, [*openings, (half - 0.3, half + 0.3, 6.0, 6.8)]).moved(-half, -half, 0.0)
    trim = joined(
        [
            box((-half - 0.1, -half - 0.1, z0), (half - 0.2, -half + 0.2, z1))
            for z0, z1 in ((7.65, 7.85), (top - 0.16, top))
        ]
        + [box((-0.62, -half - 0.08, 8.18), (0.62, -half + 0.1, 8.3))]
    )
    keep, width, length = hip(half, 0.35, rise)
    columns, rows = int(width / TILE_PITCH), int(length / TILE_REACH)
    slope = joined([tiled(columns, rows, random, keep).moved(-width / 2, 0.0, 0.0)])
    corner = np.array([[-width / 2, -width / 2, top], [0.0, 0.0, top + rise]])
    meshes = {
        "wall": make_mesh("Tower wall", face, [palette["plaster rose"]]),
        "trim": make_mesh("Tower trim", trim, [palette["stone light"]]),
        "roof": make_mesh("Tower roof", slope, [palette[name] for name in TILE_NAMES]),
        "ridge": make_mesh("Tower ridge", ridge(corner), [palette["tile brown"]]),
    }
    for quarter in range(4):
        turn = (0.0, 0.0, 90.0 * quarter)
        for part in ("wall", "trim", "ridge"):
            item = place(f"Tower {part} {quarter}", meshes[part], house, turn=turn, parent=tower)
            if part == "trim":
                bevel(item, 0.02)
        angle = quarter * pi / 2
        at = (width / 2 * sin(angle), -width / 2 * cos(angle), top)
        pitch = degrees(atan2(rise, width / 2))
        roof = place(f"Tower roof {quarter}", meshes["roof"], house, at, (pitch, 0.0, 90.0 * quarter), parent=tower)
        solidify(roof, 0.016)
    build_bell(house, palette, tower, top + rise)


def build_bell(house: Any, palette: Palette, tower: Any, peak: float) -> None:
    profile = [(0.44, 0.0), (0.4, 0.06), (0.3, 0.25), (0.24, 0.45), (0.2, 0.56), (0.0, 0.62)]
    bell = make_profile("Bell", rounded(profile, 3), palette["brass"])
    spin(place("Bell", bell, house, (0.0, 0.0, 8.75), parent=tower), 24)
    beam = box((-1.3, -0.07, 9.36), (1.3, 0.07, 9.5))
    place("Bell beam", make_mesh("Bell beam", beam, [palette["wood dark"]]), house, parent=tower)
    profile = [(0.05, -0.1), (0.04, 0.25), (0.12, 0.35), (0.13, 0.42), (0.03, 0.52), (0.02, 0.95), (0.0, 1.0)]
    spike = lathe(profile, 12)
    place("Finial", make_mesh("Finial", spike, [palette["iron"]]), house, (0.0, 0.0, peak), parent=tower)


def build_garden_side(house: Any, palette: Palette, random: np.random.Generator) -> None:
    """The garden wall on the right, the small house at its end, and the stairs to its door."""
    x = BAY_LINE + 0.3
    garden = box((0.0, -14.0, -0.3), (0.45, 2.4, 3.0))
    place("Garden wall", make_mesh("Garden wall", garden, [palette["plaster light"]]), house, (x, 0.0, 0.0))
    coping = prism([(-0.08, 0.0), (0.53, 0.0), (0.53, 0.07), (0.225, 0.2), (-0.08, 0.07)], 0.78)
    item = place("Coping", make_mesh("Coping", coping, [palette["stone light"]]), house, (x, -14.0, 3.0))
    bevel(item, 0.015)
    repeat(item, 20, (0.0, 0.8, 0.0))
    build_small_house(house, palette, random, x)
    build_stairs(house, palette, x)


def build_small_house(house: Any, palette: Palette, random: np.random.Generator, x: float) -> None:
    depth, width, top = 3.6, 3.6, 5.55
    y = 2.4 + width
    # Its long face looks at the court (-X): made facing -Y and turned by a quarter.
    west = wall(width - 0.3, top, 0.3, [(width - 1.75, width - 0.75, 2.7, 4.72), (0.5, 1.2, 3.5, 4.5)])
    south = wall(depth, top, 0.3, [(1.35, 2.25, 3.7, 4.75)]).moved(x, 2.4, 0.0)
    walls = joined([west.turned_z(-pi / 2).moved(x, y, 0.0), south])
    place("Small house", make_mesh("Small house", walls, [palette["plaster rose"]]), house)
    leaf = make_mesh("House door", door(1.0, 2.0), [palette["shutter"], palette["iron"], palette["stone light"]])
    bevel(place("House door", leaf, house, (x + 0.1, y - width + 1.25, 2.72), (0.0, 0.0, -90.0)), 0.012)
    pane = make_mesh("House window", window_frame(0.9, 1.05), [palette["wood dark"], palette["glass"]])
    place("House window", pane, house, (x + 1.8, 2.56, 3.7))
    slim = make_mesh("House window slim", window_frame(0.7, 1.0), [palette["wood dark"], palette["glass"]])
    place("House window slim", slim, house, (x + 0.16, y - 0.85, 3.5), (0.0, 0.0, -90.0))
    keep, span, length = hip(width / 2, 0.35, 1.15)
    tiles = [palette[name] for name in TILE_NAMES]
    columns, rows = int(span / TILE_PITCH), int(length / TILE_REACH)
    slope = tiled(columns, rows, random, keep).moved(-span / 2, 0.0, 0.0)
    mesh = make_mesh("House roof", slope, tiles)
    corner = np.array([[-span / 2, -span / 2, 0.0], [0.0, 0.0, 1.15]])
    ridge_mesh = make_mesh("House ridge", ridge(corner), [palette["tile brown"]])
    centre = np.array([x + width / 2, y - width / 2, top])
    for quarter in range(4):
        angle = quarter * pi / 2
        at = centre + np.array([span / 2 * sin(angle), -span / 2 * cos(angle), 0.0])
        pitch = degrees(atan2(1.15, span / 2))
        solidify(place(f"House roof {quarter}", mesh, house, at, (pitch, 0.0, 90.0 * quarter)), 0.016)
        place(f"House ridge {quarter}", ridge_mesh, house, centre, (0.0, 0.0, 90.0 * quarter))
    under = lathe([(0.0, -0.05), (hypot(span, span) / 2 - 0.1, -0.05), (0.0, 1.1)], 4, pi / 4)
    place("House roof board", make_mesh("House roof board", under, [palette["wood dark"]]), house, centre)


def build_stairs(house: Any, palette: Palette, x: float) -> None:
    """Fifteen steps of stone along the garden wall, a landing, and a balustrade of iron."""
    steps, rise, run, width = 15, 0.18, 0.3, 1.25
    start = 2.4 - steps * run + 0.1
    outline = [(0.0, 0.0)]
    for step in range(steps):
        outline += [(step * run, (step + 1) * rise), ((step + 1) * run, (step + 1) * rise)]
    landing = steps * run + 1.7
    outline = [(0.0, 0.0), (landing, 0.0), (landing, steps * rise), *outline[:0:-1]]
    # The outline lies in XZ; turned, its X runs along +Y and its depth towards -X.
    solid = prism(outline, width).turned_z(pi / 2)
    item = place("Stairs", make_mesh("Stairs", solid, [palette["plaster light"]], None), house, (x, start, 0.0))
    treads = box((-width - 0.05, -0.04, -0.05), (0.0, run, 0.012))
    item = place("Treads", make_mesh("Tread", treads, [palette["stone light"]]), house, (x, start, rise))
    bevel(item, 0.015)
    repeat(item, steps, (0.0, run, rise))
    slab = box((-width - 0.05, 0.0, -0.05), (0.0, 1.72, 0.012))
    item = place(
        "Landing", make_mesh("Landing", slab, [palette["stone light"]]), house, (x, start + steps * run, steps * rise)
    )
    bevel(item, 0.015)
    baluster = lathe([(0.012, 0.0), (0.012, 0.35), (0.028, 0.42), (0.012, 0.49), (0.012, 0.9)], 8)
    mesh = make_mesh("Baluster", baluster, [palette["iron"]])
    edge = x - width + 0.04
    item = place("Balusters", mesh, house, (edge, start + run / 2, rise + 0.01))
    repeat(item, steps, (0.0, run, rise))
    item = place("Balusters landing", mesh, house, (edge, start + steps * run + 0.14, steps * rise + 0.01))
    repeat(item, 6, (0.0, 0.28, 0.0))
    top, end = steps * rise + 0.9, start + steps * run + 1.68
    rail = [
        (edge, start + 0.02, rise + 0.83),
        (edge, start + steps * run - 0.1, top - 0.03),
        (edge, start + steps * run + 0.2, top),
    ]
    handrail = make_curve("Handrail", [[*rail, (edge, end, top)]], 0.026, palette["iron"])
    for point in handrail.splines[0].bezier_points:
        point.handle_left_type = point.handle_right_type = "VECTOR"
    place("Handrail", handrail, house)
