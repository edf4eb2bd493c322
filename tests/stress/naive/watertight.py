"""Woop, Benthin and Wald's watertight ray-triangle test (2013) in float32, and in double where an edge's side is 0."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

_PAIRS_AT_A_TIME = 1_000_000

Bools = npt.NDArray[np.bool_]
Float32Array = npt.NDArray[np.float32]


def are_hits(corners: npt.ArrayLike, origins: npt.ArrayLike, directions: npt.ArrayLike) -> Bools:
    """(R,) whether each ray (R, 3) meets any of the triangles (T, 3, 3), by trying them all."""
    triangles, starts, ways = (np.asarray(values, np.float32) for values in (corners, origins, directions))
    found = np.zeros(len(starts), np.bool_)
    step = max(1, _PAIRS_AT_A_TIME // max(1, len(triangles)))
    for start in range(0, len(starts), step):
        part = slice(start, start + step)
        found[part] = _meet(triangles, starts[part], ways[part]).any(axis=1)
    return found


def _meet(triangles: Float32Array, origins: Float32Array, directions: Float32Array) -> Bools:
    """Every ray (R) with every triangle (T)."""
    seen = triangles[None] - origins[:, None, None]
    x, y, z = _sheared(seen, directions)
    sides = [_side(x, y, (row + 1) % 3, (row + 2) % 3) for row in range(3)]
    with np.errstate(all="ignore"):
        weights = np.stack(sides, axis=-1)
        determinant = weights.sum(axis=-1)
        t = (weights * z).sum(axis=-1) / determinant
        inside = (weights >= 0).all(axis=-1) | (weights <= 0).all(axis=-1)
        return np.asarray(inside & (determinant != 0) & (t > 0))


def _sheared(seen: Float32Array, directions: Float32Array) -> tuple[Float32Array, Float32Array, Float32Array]:
    """(R, T, 3 corners) each of x, y and z, where the ray runs along z, one unit for each of its t."""
    rows = np.arange(len(directions))
    along = np.abs(directions).argmax(axis=1)
    first, second = (along + 1) % 3, (along + 2) % 3
    way = directions[rows, along]
    first, second = np.where(way < 0, second, first), np.where(way < 0, first, second)
    slopes = [(directions[rows, axis] / way)[:, None, None] for axis in (first, second)]
    part = [seen[rows, :, :, axis] for axis in (first, second, along)]
    x, y = (part[i] - slopes[i] * part[2] for i in range(2))
    return x, y, part[2] / way[:, None, None]


def _side(x: Float32Array, y: Float32Array, start: int, end: int) -> Float32Array:
    """Twice the area of the ray and an edge; in double precision where float32 gives 0."""
    found = x[..., start] * y[..., end] - y[..., start] * x[..., end]
    exact = x[..., start].astype(np.float64) * y[..., end] - y[..., start].astype(np.float64) * x[..., end]
    return np.where(found == 0, exact, found).astype(np.float32)
