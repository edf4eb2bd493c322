"""Curves as tubes of six sides, open at their ends, and points as octahedra, for those who trace only triangles."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from benchmarks.generated_curves import BenchBalls

SIDES = 6
_OCTAHEDRON = np.array([[(i >> axis & 1) * 3 + axis for axis in range(3)] for i in range(8)])

Mesh = tuple[npt.NDArray[np.float32], npt.NDArray[np.int32], npt.NDArray[np.int64]]


def tessellated(balls: BenchBalls) -> Mesh:
    """Positions (V, 3), triangles (T, 3), and of which curve or point each triangle is (T,)."""
    if balls.offsets is None:
        return _octahedra(balls)
    points, radii = balls.points.astype(np.float64), balls.radii.astype(np.float64)
    numbers = np.repeat(np.arange(len(balls.offsets) - 1), np.diff(balls.offsets))
    rows = np.arange(len(points))
    before = np.maximum(rows - 1, balls.offsets[numbers])
    after = np.minimum(rows + 1, balls.offsets[numbers + 1] - 1)
    across, beside = _frame(points[after] - points[before])
    turn = 2.0 * np.pi * np.arange(SIDES) / SIDES
    way = np.cos(turn)[:, None] * across[:, None] + np.sin(turn)[:, None] * beside[:, None]
    rings = points[:, None] + radii[:, None, None] * way
    first = rows[after > rows]  # of each segment
    side = np.arange(SIDES)
    near, near_next = first[:, None] * SIDES + side, first[:, None] * SIDES + (side + 1) % SIDES
    halves = ((near, near_next, near_next + SIDES), (near, near_next + SIDES, near + SIDES))
    triangles = np.stack([np.stack(half, axis=-1) for half in halves], axis=2).reshape(-1, 3)
    return (
        rings.reshape(-1, 3).astype(np.float32),
        triangles.astype(np.int32),
        np.repeat(numbers[first], 2 * SIDES),
    )


def _octahedra(balls: BenchBalls) -> Mesh:
    ways = np.concatenate([-np.eye(3), np.eye(3)]).astype(np.float32)
    positions = balls.points[:, None] + balls.radii[:, None, None] * ways
    triangles = 6 * np.arange(len(balls.points))[:, None, None] + _OCTAHEDRON
    return (
        positions.reshape(-1, 3),
        triangles.reshape(-1, 3).astype(np.int32),
        np.repeat(np.arange(len(balls.points)), 8),
    )


def _frame(along: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Two unit vectors at right angles to each row and to each other; of a row of zeros, to x."""
    length = np.linalg.norm(along, axis=1, keepdims=True)
    way = np.where(length > 0.0, along / np.where(length > 0.0, length, 1.0), [1.0, 0.0, 0.0])
    least = np.where(np.abs(way[:, :1]) < 0.5, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    across = np.cross(way, least)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return across, np.cross(way, across)
