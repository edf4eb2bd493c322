"""Terracotta roofs: barrel tiles laid by hand, each a little off its line, over a board."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin

import numpy as np

from ..shapes import Points, Shape, box, joined, shape

TILE_PITCH = 0.235
TILE_REACH = 0.37
TILE_SLOTS = (0, 0, 0, 1, 1, 2)
TILE_NAMES = ("tile red", "tile orange", "tile brown", "wood dark")


def barrel(segments: int = 5) -> Shape:
    """One tile: half a barrel along +Y, wider at its lower end, so that the next row slips under it."""
    rows = []
    for y, radius, lift in ((-0.04, 0.118, 0.035), (TILE_REACH + 0.05, 0.09, 0.0)):
        angles = np.linspace(pi, 0.0, segments + 1)
        rows += [(radius * cos(angle), y, lift + radius * 0.85 * sin(angle)) for angle in angles]
    count = segments + 1
    return shape(rows, [(k, k + 1, k + 1 + count, k + count) for k in range(segments)])


def tiled(
    columns: int,
    rows: int,
    random: np.random.Generator,
    keep: Callable[[float, float], bool] = lambda across, up: True,
) -> Shape:
    """Tiles on the XY plane, eave along y = 0, with seeded slips; keep(x, y) trims the outline."""
    tile = barrel()
    tiles = []
    for row in range(rows):
        for column in range(columns):
            x, y = (column + 0.5) * TILE_PITCH, row * TILE_REACH
            slips, yaw, slot = random.normal(0.0, 0.007, 3), random.normal(0.0, 0.018), random.integers(6)
            if keep(x, y):
                laid = tile.turned_z(yaw).moved(x + slips[0], y + 2 * slips[1], abs(slips[2]))
                tiles.append(laid.painted(TILE_SLOTS[slot]))
    return joined(tiles)


def board(width: float, length: float, slot: int) -> Shape:
    """The board below the tiles: slot for its wood, the last of the roof's materials."""
    return box((0.0, 0.02, -0.07), (width, length, 0.015)).painted(slot)


def hip(half_width: float, overhang: float, rise: float) -> tuple[Callable[[float, float], bool], float, float]:
    """One face of a pyramid roof: which tiles to keep, its width and its length up the slope."""
    width = 2.0 * (half_width + overhang)
    length = float(np.hypot(width / 2.0, rise))

    def keep(across: float, up: float) -> bool:
        return abs(across - width / 2.0) < (width / 2.0) * (1.0 - up / length) + 0.03

    return keep, width, length


def ridge(path: Points, radius: float = 0.12) -> Shape:
    """Cap tiles along a straight line from path[0] to path[1]."""
    start, end = path
    along = end - start
    length = float(np.linalg.norm(along))
    forward = along / length
    side = np.cross(forward, (0.0, 0.0, 1.0))
    side /= np.linalg.norm(side)
    frame = np.column_stack([side, forward, np.cross(side, forward)])
    count = max(1, round(length / TILE_REACH))
    cap = barrel().scaled(radius / 0.105, length / count / TILE_REACH, radius / 0.105)
    return joined([cap.moved(y=k * length / count).turned(frame).moved(*start) for k in range(count)])
