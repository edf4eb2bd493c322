"""A tablecloth that falls over a ball: a deforming sheet, simulated here and baked as shape keys.

A mass-spring sheet is stepped by position-based dynamics; some of its states become keys that are mixed over the 48
frames, and a subdivision surface smooths the result.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .shapes import Points, Shape, box, grid, joined, lathe
from .stage import (
    add_camera,
    add_light,
    animation_curves,
    bevel,
    light_world,
    make_collection,
    make_mesh,
    open_stage,
    paint,
    place,
    repeat,
    subdivide,
)

FRAMES = 48
CELLS, SIDE = 46, 3.7
BALL = np.array([0.0, 0.0, 1.3])
BALL_RADIUS = 1.0
START_HEIGHT = 3.05
KEY_FRAMES = (1, 6, 9, 12, 16, 20, 25, 31, 38, 48)
SKIN = 0.035  # how far the sheet keeps from the ball and the floor, metres


def make() -> None:
    open_stage("Cloth", FRAMES, exposure=0.6)
    random = np.random.default_rng(60)
    states = simulate(random)
    set_up_sheet(states)
    set_up_room()
    light_world((0.60, 0.64, 0.72), 0.5)
    add_light("AREA", "Window", (-4.5, -3.0, 5.5), (0.0, 0.0, 1.0), 420.0, (1.0, 0.93, 0.82), 2.5)
    add_light("AREA", "Fill", (5.5, -4.0, 3.5), (0.0, 0.0, 1.2), 110.0, (0.72, 0.84, 1.0), 3.0)
    add_light("POINT", "Rim", (1.5, 4.0, 3.6), (0.0, 0.0, 1.0), 160.0, (1.0, 0.80, 0.60), 0.3)
    add_camera((2.6, -7.2, 3.15), (0.0, 0.0, 1.28), 43.0)


# The simulation ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Springs:
    """Pairs of grid points with a rest length and a stiffness, in groups where no point occurs twice."""

    groups: list[tuple[NDArray[np.int64], NDArray[np.int64], float, float]]


def make_springs(stride: int, cell: float) -> Springs:
    """Structure along rows and columns, shear along diagonals, bending over two cells."""
    index = np.arange(stride * stride).reshape(stride, stride)
    groups = []
    for over, up, stiffness in ((1, 0, 0.9), (0, 1, 0.9), (1, 1, 0.2), (1, -1, 0.2), (2, 0, 0.04), (0, 2, 0.04)):
        low, high = max(0, -up), stride - max(0, up)
        first = index[low:high, : stride - over]
        second = index[low + up : high + up, over:]
        # Two or four colours: along the direction of travel no two springs of a group share a point.
        step = max(over, abs(up))
        rows, columns = np.indices(first.shape)
        colour = ((columns if over else rows) // step) % 2
        for part in (0, 1):
            chosen = colour == part
            groups.append((first[chosen], second[chosen], cell * float(np.hypot(over, up)), stiffness))
    return Springs(groups)


def simulate(random: np.random.Generator) -> list[Points]:
    """The sheet's points (P, 3) at each of KEY_FRAMES, rounded so that they pack well."""
    sheet = grid(CELLS, CELLS, SIDE, SIDE).turned_z(0.35).vertices
    position = sheet + np.array([0.06, -0.04, START_HEIGHT])
    position[:, 2] += random.normal(0.0, 0.004, len(position))
    springs = make_springs(CELLS + 1, SIDE / CELLS)
    before = position.copy()
    substeps, rounds = 10, 9
    step = 1.0 / (24.0 * substeps)
    states = []
    for frame in range(1, FRAMES + 1):
        if frame in KEY_FRAMES:
            states.append(np.round(position * 2048.0) / 2048.0)
        for _ in range(substeps):
            velocity = (position - before) * 0.988
            before = position.copy()
            position = position + velocity + np.array([0.0, 0.0, -9.81 * step * step])
            for _ in range(rounds):
                relax(position, springs)
            collide(position, before)
    return states


def relax(position: Points, springs: Springs) -> None:
    """One round of corrections, in place: each spring's ends move towards its rest length."""
    for first, second, rest, stiffness in springs.groups:
        gap = position[second] - position[first]
        length = np.linalg.norm(gap, axis=1, keepdims=True)
        push = gap * (0.5 * stiffness * (1.0 - rest / np.maximum(length, 1e-9)))
        position[first] += push
        position[second] -= push


def collide(position: Points, before: Points) -> None:
    """Keeps points out of ball and floor, in place, and takes most of their sliding there: friction."""
    away = position - BALL
    distance = np.linalg.norm(away, axis=1)
    inside = distance < BALL_RADIUS + SKIN
    position[inside] = BALL + away[inside] * ((BALL_RADIUS + SKIN) / distance[inside, None])
    below = position[:, 2] < SKIN
    position[below, 2] = SKIN
    before[inside] += (position[inside] - before[inside]) * 0.35
    before[below] += (position[below] - before[below]) * 0.6


# The scene -----------------------------------------------------------------------------------------------------------


def set_up_sheet(states: list[Points]) -> None:
    sheet = grid(CELLS, CELLS, SIDE, SIDE)
    sheet = Shape(states[0], sheet.faces, [checked(k // CELLS, k % CELLS) for k in range(len(sheet.faces))])
    materials = [paint("Linen", (0.80, 0.74, 0.63), 0.85), paint("Blue check", (0.30, 0.42, 0.58), 0.85)]
    materials += [paint("Deep blue", (0.055, 0.13, 0.30), 0.85), paint("Hem", (0.62, 0.10, 0.07), 0.85)]
    item = place("Cloth", make_mesh("Cloth", sheet, materials, 180.0), make_collection("Cloth"))
    item.shape_key_add(name="Basis")
    for frame, state in zip(KEY_FRAMES[1:], states[1:], strict=True):
        key = item.shape_key_add(name=f"Frame {frame}")
        key.data.foreach_set("co", state.astype(np.float32).ravel())
    set_mix(item.data.shape_keys)
    subdivide(item, 2)


def set_mix(keys: Any) -> None:
    """Each key is whole at its own frame and fades straight to nothing at its neighbours'."""
    for number, frame in enumerate(KEY_FRAMES[1:], start=1):
        block = keys.key_blocks[f"Frame {frame}"]
        marks = [(KEY_FRAMES[number - 1], 0.0), (frame, 1.0)]
        if number + 1 < len(KEY_FRAMES):
            marks.append((KEY_FRAMES[number + 1], 0.0))
        for at, value in marks:
            block.value = value
            block.keyframe_insert("value", frame=at)
    for curve in animation_curves(keys):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"


def checked(row: int, column: int) -> int:
    """The slot of a cell: a red hem, and a gingham of crossing blue bands on linen."""
    if min(row, column, CELLS - 1 - row, CELLS - 1 - column) < 1:
        return 3
    return (row // 4) % 2 + (column // 4) % 2


def set_up_room() -> None:
    """Boards, a skirting wall, a stand below the ball, and two small balls that the cloth does not touch."""
    room = make_collection("Room")
    boards = make_mesh("Board", box((-9.0, 0.0, -0.1), (9.0, 0.58, 0.0)), [paint("Boards", (0.36, 0.225, 0.13), 0.5)])
    floor = place("Floor", boards, room, (0.0, -7.0, 0.0))
    bevel(floor, 0.012, 2)
    repeat(floor, 18, (0.0, 0.6, 0.0))
    wall = joined([box((-9.0, 3.7, 0.0), (9.0, 3.9, 6.5)), box((-9.0, 3.64, 0.0), (9.0, 3.72, 0.22)).painted(1)])
    place(
        "Wall",
        make_mesh("Wall", wall, [paint("Wall", (0.47, 0.52, 0.47)), paint("Skirting", (0.74, 0.70, 0.62))]),
        room,
    )
    ball = place(
        "Ball",
        make_mesh("Ball", sphere(1.0), [paint("Ball", (0.70, 0.16, 0.06), 0.3)], 180.0),
        room,
        BALL,
        size=BALL_RADIUS,
    )
    subdivide(ball, 1)
    profile = [
        (0.62, 0.0),
        (0.62, 0.06),
        (0.5, 0.1),
        (0.4, 0.16),
        (0.36, 0.3),
        (0.42, 0.42),
        (0.5, 0.48),
        (0.44, 0.5),
        (0.0, 0.3),
    ]
    stand = place(
        "Stand", make_mesh("Stand", lathe(profile, 40), [paint("Stand", (0.20, 0.12, 0.07), 0.4)], 40.0), room
    )
    bevel(stand, 0.01, 2)
    small = make_mesh("Small ball", sphere(1.0), [paint("Small ball", (0.80, 0.55, 0.09), 0.3)], 180.0)
    for number, (x, y, size) in enumerate(((-2.75, -0.9, 0.28), (2.7, 0.9, 0.34))):
        subdivide(place(f"Small ball {number}", small, room, (x, y, size), size=size), 1)


def sphere(radius: float) -> Shape:
    angles = np.linspace(-pi / 2, pi / 2, 17)[1:-1]
    return lathe([(0.0, -radius), *[(radius * cos(a), radius * sin(a)) for a in angles], (0.0, radius)], 32)
