"""The small meshes that failure cases are made of: (V, 3) float64 positions and (T, 3) int32 triangles."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Mesh = tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]


def ball(levels: int, radius: float = 1.0, centre: npt.ArrayLike = (0.0, 0.0, 0.0)) -> Mesh:
    """A closed sphere of 8 * 4^levels triangles: an octahedron, divided."""
    positions = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], np.float64)
    triangles = np.array([(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)])
    for _ in range(levels):
        edges = np.sort(triangles[:, [(0, 1), (1, 2), (2, 0)]].reshape(-1, 2), axis=1)
        edges, which = np.unique(edges, axis=0, return_inverse=True)
        middles = which.reshape(-1, 3) + len(positions)
        points = positions[edges].mean(axis=1)
        positions = np.concatenate([positions, points / np.linalg.norm(points, axis=1, keepdims=True)])
        (a, b, c), (ab, bc, ca) = triangles.T, middles.T
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
    return positions * radius + np.asarray(centre), triangles.astype(np.int32)


def room(half: float) -> Mesh:
    """The twelve triangles of a cube from -half to half, seen from inside."""
    positions = half * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return positions, np.array([row for a, b, c, d in faces for row in ((a, c, b), (a, d, c))], np.int32)


def sheet(cells: int, half: float = 1.0) -> Mesh:
    """A flat square of 2 * cells^2 triangles in the plane z = 0, from -half to half, facing up."""
    line = np.linspace(-half, half, cells + 1)
    x, y = np.meshgrid(line, line)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    lower = np.stack([corner, corner + 1, corner + cells + 2], axis=1)
    upper = np.stack([corner, corner + cells + 2, corner + cells + 1], axis=1)
    triangles = np.stack([lower, upper], axis=1).reshape(-1, 3)
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1), triangles.astype(np.int32)


def loose(corners: npt.ArrayLike) -> Mesh:
    """A mesh of triangles (T, 3, 3) that share no vertex."""
    points = np.asarray(corners, np.float64).reshape(-1, 3)
    return points, np.arange(len(points), dtype=np.int32).reshape(-1, 3)


def gravel(count: int, seed: int, size: float, spread: npt.ArrayLike = 1.0) -> Mesh:
    """Small loose triangles at random in a box from -spread to spread."""
    random = np.random.default_rng(seed)
    centres = random.uniform(-1.0, 1.0, (count, 1, 3)) * np.asarray(spread)
    return loose(centres + random.normal(0.0, size, (count, 3, 3)))


def joined(*meshes: Mesh) -> Mesh:
    """One mesh of several."""
    firsts = np.cumsum([0, *(len(positions) for positions, _ in meshes)])
    triangles = [rows + first for (_, rows), first in zip(meshes, firsts[:-1], strict=True)]
    return np.concatenate([positions for positions, _ in meshes]), np.concatenate(triangles).astype(np.int32)


def turned(axis: int, angle: float) -> npt.NDArray[np.float64]:
    """(4, 4): a turn about a coordinate axis, in radians."""
    matrix = np.eye(4)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix[first, first] = matrix[second, second] = np.cos(angle)
    matrix[second, first] = np.sin(angle)
    matrix[first, second] = -matrix[second, first]
    return matrix


def moved(offset: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """(4, 4): a shift."""
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix
