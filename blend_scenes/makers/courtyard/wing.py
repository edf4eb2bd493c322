"""One wing of the cloister, along y = BAY_LINE: arcade, walk, rear wall with doors and windows, roofs."""

from __future__ import annotations

from math import atan2, cos, degrees, pi, sin
from typing import Any

import bpy
import numpy as np

from ..shapes import Shape, box, joined, lathe, prism, shape, wall
from ..stage import bevel, make_mesh, place, repeat, solidify
from .joinery import door, shutter, window_frame
from .palette import Palette
from .roofs import TILE_NAMES, TILE_PITCH, TILE_REACH, board, tiled

BAY = 2.48
BAYS = 5
BAY_LINE = 6.2
SPRING, ARCADE_TOP = 2.28, 3.72
FLOOR = 0.18
WALK_WALL = 8.7
WALL_TOP = 7.3


def build_wing(wing: Any, palette: Palette, random: np.random.Generator) -> None:
    build_arcade(wing, palette)
    build_walk(wing, palette)
    build_wing_roofs(wing, palette, random)


def arch_bay(segments: int = 20, depth: float = 0.42) -> Shape:
    """The wall over one bay, centred on x = 0, with a round arch cut from below. Its ends stay open."""
    radius = BAY / 2 - 0.21
    angles = np.linspace(pi, 0.0, segments + 1)
    arch = [(radius * cos(angle), SPRING + radius * sin(angle)) for angle in angles]
    low = [(-BAY / 2, SPRING), *arch, (BAY / 2, SPRING)]
    count = len(low)
    near = [(x, 0.0, z) for x, z in low] + [(x, 0.0, ARCADE_TOP) for x, _ in low]
    far = [(x, depth, z) for x, _, z in near]
    back = len(near)
    faces = []
    for k in range(count - 1):
        faces.append((k, k + 1, count + k + 1, count + k))
        faces.append((back + k + 1, back + k, back + count + k, back + count + k + 1))
        faces.append((k + 1, k, back + k, back + k + 1))
        faces.append((count + k, count + k + 1, back + count + k + 1, back + count + k))
    return shape(near + far, faces)


def archivolt(segments: int = 20) -> Shape:
    """The raised band round the arch, and its keystone."""
    inner, outer, lift = BAY / 2 - 0.225, BAY / 2 - 0.06, 0.05
    rows = [(inner, 0.03), (inner, -lift), (outer - 0.04, -lift), (outer, -lift * 0.4), (outer, 0.03)]
    vertices = []
    for angle in np.linspace(pi, 0.0, segments + 1):
        vertices += [(radius * cos(angle), y, SPRING + radius * sin(angle)) for radius, y in rows]
    count = len(rows)
    faces = [
        (a, a + count, a + count + 1, a + 1)
        for step in range(segments)
        for a in range(step * count, step * count + count - 1)
    ]
    band = shape(vertices, faces)
    top = SPRING + outer
    key = prism([(-0.07, top - 0.2), (0.07, top - 0.2), (0.12, top + 0.09), (-0.12, top + 0.09)], 0.12).moved(y=-0.1)
    return joined([band, key])


def column() -> Shape:
    """Plinth, base, swelling shaft, leaf-less capital and abacus, from the walk's floor to the spring of the arch."""
    height = SPRING - FLOOR
    profile = [(0.0, 0.11), (0.235, 0.11), (0.25, 0.14), (0.235, 0.18), (0.2, 0.2), (0.195, 0.23)]
    profile += [(0.21, 0.245), (0.205, 0.27), (0.175, 0.29)]
    for up in np.linspace(0.0, 1.0, 7):
        profile.append((0.172 + 0.008 * sin(pi * up) - 0.027 * up, 0.31 + up * (height - 0.78)))
    neck = height - 0.45
    profile += [(0.165, neck), (0.165, neck + 0.03), (0.148, neck + 0.05), (0.152, neck + 0.12)]
    profile += [(0.175, neck + 0.2), (0.222, neck + 0.29), (0.235, neck + 0.32), (0.0, neck + 0.32)]
    turned = lathe(profile, 20)
    plinth = box((-0.26, -0.26, 0.0), (0.26, 0.26, 0.115))
    abacus = joined(
        [
            box((-0.25, -0.25, height - 0.14), (0.25, 0.25, height - 0.07)),
            box((-0.28, -0.28, height - 0.07), (0.28, 0.28, height)),
        ]
    )
    return joined([turned, plinth, abacus]).moved(z=FLOOR)


def build_arcade(wing: Any, palette: Palette) -> None:
    start = -BAY_LINE + BAY / 2
    plaster, stone, light = palette["plaster light"], palette["stone"], palette["stone light"]
    bays = place("Arches", make_mesh("Arch bay", arch_bay(), [plaster]), wing, (start, BAY_LINE - 0.21, 0.0))
    repeat(bays, BAYS, (BAY, 0.0, 0.0))
    bands = place("Archivolts", make_mesh("Archivolt", archivolt(), [light]), wing, (start, BAY_LINE - 0.21, 0.0))
    repeat(bands, BAYS, (BAY, 0.0, 0.0))
    columns = place("Columns", make_mesh("Column", column(), [light]), wing, (BAY - BAY_LINE, BAY_LINE, 0.0))
    bevel(columns, 0.012, 2, 60.0)
    repeat(columns, BAYS - 1, (BAY, 0.0, 0.0))
    pier = joined(
        [
            box((-0.3, -0.3, FLOOR), (0.3, 0.3, ARCADE_TOP)),
            box((-0.36, -0.36, FLOOR), (0.36, 0.36, FLOOR + 0.24)),
            box((-0.36, -0.36, SPRING - 0.14), (0.36, 0.36, SPRING)),
        ]
    )
    bevel(place("Corner pier", make_mesh("Pier", pier, [light]), wing, (-BAY_LINE, BAY_LINE, 0.0)), 0.02)
    profile = [(0.0, 0.0), (0.12, 0.0), (0.16, -0.05), (0.1, -0.1), (0.07, -0.2), (0.0, -0.24)]
    cornice = moulding(profile, -BAY_LINE, BAY_LINE).moved(y=BAY_LINE - 0.21, z=ARCADE_TOP + 0.02)
    place("Cornice", make_mesh("Cornice", cornice, [stone]), wing)


def build_wing_end(house: Any, palette: Palette) -> None:
    """Closes the back wing where no other wing follows: a pier and the last of the floor."""
    edge, right = BAY_LINE - 0.42, WALK_WALL - 0.2
    pier = place("End pier", bpy.data.meshes["Pier"], house, (BAY_LINE + 0.1, BAY_LINE, 0.0))
    bevel(pier, 0.02)
    floor = joined(
        [
            box((edge, edge, -0.3), (right, WALK_WALL, FLOOR)),
            box((edge - 0.36, edge - 0.36, -0.3), (right, edge, FLOOR / 2)),
        ]
    )
    bevel(place("Walk end", make_mesh("Walk end", floor, [palette["stone"]]), house), 0.02)


def moulding(profile: list[tuple[float, float]], start: float, end: float) -> Shape:
    """A profile of (how far it projects towards -Y, z), from top to bottom, extruded along X."""
    count = len(profile)
    vertices = [(x, -out, z) for x in (start, end) for out, z in profile]
    return shape(vertices, [(k, k + 1, k + 1 + count, k + count) for k in range(count - 1)])


def build_walk(wing: Any, palette: Palette) -> None:
    """Floor, rear wall with doors below and windows above, shutters, sills."""
    x0, x1 = -WALK_WALL, WALK_WALL
    edge, step = BAY_LINE - 0.42, BAY_LINE - 0.78
    # Each wing's floor ends where the next begins, so that nothing lies twice in the corner.
    floor = joined([box((x0, edge, -0.3), (edge, WALK_WALL, FLOOR)), box((-edge, step, -0.3), (step, edge, FLOOR / 2))])
    bevel(place("Walk", make_mesh("Walk", floor, [palette["stone"]]), wing), 0.02)
    centres = [-BAY_LINE + BAY * (bay + 0.5) for bay in range(BAYS)]
    doors = [(x - 0.62 - x0, x + 0.62 - x0, 0.0, 2.35) for x in (centres[1], centres[3])]
    grilles = [(x - 0.45 - x0, x + 0.45 - x0, 1.15, 2.15) for x in (centres[0], centres[2], centres[4])]
    windows = [(x - 0.46 - x0, x + 0.46 - x0, 5.35, 6.7) for x in centres]
    rear = wall(x1 - x0, WALL_TOP, 0.4, doors + grilles + windows).moved(x0, WALK_WALL, 0.0)
    place("Rear wall", make_mesh("Rear wall", rear, [palette["plaster"]]), wing)
    base = box((x0, WALK_WALL - 0.03, FLOOR), (x1, WALK_WALL + 0.1, FLOOR + 0.22))
    base = joined([base, box((x0, WALK_WALL - 0.05, 5.02), (x1, WALK_WALL + 0.1, 5.16))])
    bevel(place("String courses", make_mesh("String courses", base, [palette["stone"]]), wing), 0.015)
    build_openings(wing, palette, centres)


def build_wing_roofs(wing: Any, palette: Palette, random: np.random.Generator) -> None:
    """The lean-to over the walk, and the eave of the main roof."""
    tiles = [palette[name] for name in TILE_NAMES]
    columns, patches = 7, 11
    width = columns * TILE_PITCH
    for name, at, rise, run, rows in (
        ("Lean-to", (-9.05, BAY_LINE - 0.72, ARCADE_TOP + 0.04), 1.28, WALK_WALL - BAY_LINE + 0.75, 9),
        ("Main roof", (-9.05, WALK_WALL - 0.6, WALL_TOP + 0.02), 0.75, 1.75, 5),
    ):
        slope = degrees(atan2(rise, run))
        patch = tiled(columns, rows, random)
        item = place(name, make_mesh(f"{name} tiles", patch, tiles), wing, at, (slope, 0.0, 0.0))
        solidify(item, 0.016)
        repeat(item, patches, (width, 0.0, 0.0))
        under = board(width * patches, rows * TILE_REACH, 3)
        place(f"{name} board", make_mesh(f"{name} board", under, tiles), wing, at, (slope, 0.0, 0.0))
    rafter = box((-0.05, 0.02, -0.16), (0.05, 0.9, -0.07))
    for name, at, slope in (
        ("Rafters", (-BAY_LINE - 1.9, WALK_WALL - 0.6, WALL_TOP + 0.02), degrees(atan2(0.75, 1.75))),
        ("Rafters low", (-BAY_LINE + 0.31, BAY_LINE - 0.72, ARCADE_TOP + 0.05), degrees(atan2(1.28, 3.25))),
    ):
        rafters = place(name, make_mesh(name, rafter, [palette["wood dark"]]), wing, at, (slope, 0.0, 0.0))
        repeat(rafters, 24 if name == "Rafters" else 20, (0.62, 0.0, 0.0))


def build_openings(wing: Any, palette: Palette, centres: list[float]) -> None:
    """Fills the rear wall's openings: frames and panes, doors, shutters half open."""
    frame_mesh = make_mesh("Window", window_frame(0.92, 1.35), [palette["wood dark"], palette["glass"]])
    sill_mesh = make_mesh("Sill", box((-0.58, -0.12, -0.09), (0.58, 0.1, 0.0)), [palette["stone light"]])
    shutter_mesh = make_mesh("Shutter", shutter(0.46, 1.33), [palette["shutter"]])
    for number, x in enumerate(centres):
        place(f"Window {number}", frame_mesh, wing, (x, WALK_WALL + 0.16, 5.35))
        bevel(place(f"Sill {number}", sill_mesh, wing, (x, WALK_WALL, 5.35)), 0.015)
        opened = (8.0, 22.0, 5.0, 14.0, 65.0)[number]
        place(f"Shutter left {number}", shutter_mesh, wing, (x - 0.47, WALK_WALL - 0.05, 5.36), (0, 0, 180 + opened))
        place(f"Shutter right {number}", shutter_mesh, wing, (x + 0.47, WALK_WALL - 0.05, 5.36), (0, 0, -opened / 2))
    grille_mesh = make_mesh("Low window", window_frame(0.9, 1.0), [palette["wood dark"], palette["glass"]])
    for number in (0, 2, 4):
        place(f"Low window {number}", grille_mesh, wing, (centres[number], WALK_WALL + 0.16, 1.15))
    door_mesh = make_mesh("Door", door(1.24, 2.17), [palette["wood"], palette["iron"], palette["stone light"]])
    for number in (1, 3):
        item = place(f"Door {number}", door_mesh, wing, (centres[number], WALK_WALL + 0.12, FLOOR))
        bevel(item, 0.012)
