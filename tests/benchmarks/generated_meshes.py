"""Meshes made from seeds, each hard for trees in a different way: a city, foliage, hair. Their up is y."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from benchmarks.meshes import BenchMesh

F64 = npt.NDArray[np.float64]

# Corners of a box, bit by bit x, y, z; two triangles a side, counter-clockwise from outside.
_BOX = np.array(
    [[0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5], [0, 1, 5], [0, 5, 4], [2, 6, 7], [2, 7, 3], [0, 2, 3], [0, 3, 1]]
    + [[4, 5, 7], [4, 7, 6]]
)
_QUAD = np.array([[0, 1, 2], [0, 2, 3]])


def make_all(detail: float) -> list[BenchMesh]:
    """City, foliage and hair; their numbers of triangles grow with `detail`."""
    return [city(detail), foliage(detail), hair(detail)]


def city(detail: float) -> BenchMesh:
    """20,000 axis-aligned boxes along streets, on a ground of two triangles, seen from within a street."""
    side = 2 * max(2, round(71 * detail**0.5))  # even: a street runs through the middle
    random = np.random.default_rng(31)
    x, z = (np.mgrid[0:side, 0:side].reshape(2, -1) - 0.5 * (side - 1)) * 20.0
    half = random.uniform(4.0, 8.0, (2, side * side))
    height = 6.0 + random.gamma(1.5, 12.0, side * side)
    low = np.stack([x - half[0], np.zeros_like(height), z - half[1]], axis=-1)
    high = np.stack([x + half[0], height, z + half[1]], axis=-1)
    corners = np.stack([np.where([bit & 1, bit & 2, bit & 4], high, low) for bit in range(8)], axis=1)
    reach = 10.0 * side + 40.0
    ground = np.array([[-reach, 0.0, -reach], [-reach, 0.0, reach], [reach, 0.0, reach], [reach, 0.0, -reach]])
    positions = np.concatenate([corners.reshape(-1, 3), ground])
    triangles = np.concatenate([_each(_BOX, 8, side * side), _QUAD + 8 * side * side])
    return _mesh("city", positions, triangles, is_inside=True)


def foliage(detail: float) -> BenchMesh:
    """200,000 cards, two triangles each, in the crowns of a hundred trees, turned at random, seen from among them."""
    count, trees = max(100, round(200_000 * detail)), 100
    random = np.random.default_rng(32)
    places = np.stack([random.uniform(-30.0, 30.0, trees), random.uniform(3.0, 8.0, trees)], axis=-1)
    places = np.column_stack([places, random.uniform(-30.0, 30.0, trees)])
    offsets = _directions(random, count) * random.uniform(0.3, 1.0, (count, 1)) * [2.5, 2.0, 2.5]
    middles = places[random.integers(0, trees, count)] + offsets
    along = _directions(random, count)
    across = _across(along, _directions(random, count))
    size = random.uniform(0.03, 0.08, (count, 1))
    return _mesh("foliage", *_quads(middles, size * along, 0.6 * size * across), is_inside=True)


def hair(detail: float) -> BenchMesh:
    """100,000 slanted quads on a ball, each a hundred times as long as wide, none along an axis."""
    count = max(100, round(100_000 * detail))
    random = np.random.default_rng(33)
    normals = _directions(random, count)
    along = normals + 0.8 * _directions(random, count)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    half = random.uniform(0.05, 0.15, (count, 1))
    across = _across(along, normals + 0.5 * _directions(random, count))
    return _mesh("hair quads", *_quads(normals + half * along, half * along, 0.01 * half * across))


def _mesh(name: str, positions: F64, triangles: npt.NDArray[np.int64], *, is_inside: bool = False) -> BenchMesh:
    return BenchMesh(name, positions.astype(np.float32), triangles.astype(np.int32), is_inside)


def _each(triangles: npt.NDArray[np.int64], corner_count: int, count: int) -> npt.NDArray[np.int64]:
    """The same triangles for each of `count` parts, which have this number of corners each."""
    firsts = corner_count * np.arange(count)[:, None, None]
    return np.asarray((triangles + firsts).reshape(-1, 3))


def _quads(middles: F64, along: F64, across: F64) -> tuple[F64, npt.NDArray[np.int64]]:
    """Four separate corners for each, half a length and half a width from its middle."""
    corners = np.stack(
        [middles - along - across, middles + along - across, middles + along + across, middles - along + across], axis=1
    )
    return corners.reshape(-1, 3), _each(_QUAD, 4, len(middles))


def _directions(random: np.random.Generator, count: int) -> F64:
    vectors = random.normal(size=(count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _across(along: F64, towards: F64) -> F64:
    """Returns vectors of unit length, at right angles to `along`."""
    vectors = np.cross(along, towards)
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
