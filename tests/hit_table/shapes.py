"""Meshes from integers: (positions (V, 3) float64, triangles (F, 3) int32)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from hit_table.hashing import Doubles, between, integers

Mesh = tuple[Doubles, npt.NDArray[np.int32]]


def separate(corners: Doubles) -> Mesh:
    """Triangles that share no vertex, from their corners (F, 3, 3)."""
    return corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)


def soup(count: int, seed: int) -> Mesh:
    """Triangles of up to an eighth of a unit, anywhere."""
    centres = between(-1, 1, (count, 1, 3), seed)
    return separate(centres + between(-1, 1, (count, 3, 3), seed + 1) / 16.0)


def slivers(count: int, seed: int) -> Mesh:
    """Triangles as long as the scene, and 8 to 65,536 times as thin."""
    start, along = between(-1, 1, (count, 3), seed), between(-1, 1, (count, 3), seed + 1)
    thin = 0.5 ** (3.0 + integers(14, count, seed + 2))
    return separate(np.stack([start, start + along, start + between(-1, 1, (count, 3), seed + 3) * thin[:, None]], 1))


def terrain(cells: int, seed: int, height: float = 0.25) -> Mesh:
    """A square of hills from -1 to 1; with height 0 a flat one, of vertices that rays meet exactly."""
    line = np.arange(cells + 1) * (2.0 / cells) - 1.0
    x, y = np.meshgrid(line, line)
    z = between(0, 1, x.shape, seed) * height
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1, 1)
    halves = np.array([[0, 1, cells + 2], [0, cells + 2, cells + 1]])
    triangles = (first[:, None] + halves).reshape(-1, 3).astype(np.int32)
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), triangles


def ball(levels: int, radius: float = 1.0) -> Mesh:
    """A closed sphere: an octahedron whose triangles are quartered; square roots are rounded alike everywhere."""
    axes = np.concatenate([np.eye(3), -np.eye(3)]) + 0.0  # no zero is negative: equal corners have equal bits
    faces = np.array([(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)])
    corners = axes[faces]
    for _ in range(levels):
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        ab, bc, ca = (_onto_sphere(p + q) for p, q in ((a, b), (b, c), (c, a)))
        quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])
    positions, triangles = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return positions * radius, triangles.reshape(-1, 3).astype(np.int32)


def _onto_sphere(points: Doubles) -> Doubles:
    squares = points * points
    return points / np.sqrt(squares[:, 0] + squares[:, 1] + squares[:, 2])[:, None]


def boxes(count: int, seed: int) -> Mesh:
    """Axis-parallel, from pebbles to walls, their faces on planes that they share."""
    corner = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
    quads = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    sizes = 0.5 ** (1.0 + integers(6, 3 * count, seed)).reshape(count, 1, 3)
    places = between(-1, 1, (count, 1, 3), seed + 1, bits=5)
    triangles = (8 * np.arange(count)[:, None, None] + faces).reshape(-1, 3)
    return (places + corner * sizes).reshape(-1, 3), triangles.astype(np.int32)


def fan(count: int) -> Mesh:
    """Triangles about one vertex, each over a step of a square's outline: every box holds the middle."""
    side = np.arange(count) * (2.0 / count) - 1.0
    one, other = np.ones(count), np.zeros(count)
    sides = [(side, -one, other), (one, side, other), (-side, one, other), (-one, -side, other)]
    rim = np.concatenate([np.stack(columns, axis=1) for columns in sides])
    here = np.arange(1, len(rim) + 1)
    triangles = np.stack([np.zeros_like(here), here, np.roll(here, -1)], axis=1)
    return np.concatenate([[(0.0, 0.0, 0.5)], rim]), triangles.astype(np.int32)


def matryoshka(count: int, seed: int) -> Mesh:
    """Triangles of all sizes from 2**-20 to 2, about the same places."""
    size = 0.5 ** integers(22, count, seed).astype(np.float64) * 2.0
    places = between(-1, 1, (count, 1, 3), seed + 1, bits=3)
    return separate(places + between(-1, 1, (count, 3, 3), seed + 2) * size[:, None, None])


def with_degenerate(mesh: Mesh) -> Mesh:
    """Every third triangle shrunk to an edge, a point, or listed again the other way round."""
    positions, triangles = mesh
    kinds = [triangles, triangles[::3][:, [0, 0, 1]], triangles[1::3][:, [2, 2, 2]], triangles[2::3][:, [0, 2, 1]]]
    return positions, np.concatenate(kinds)
