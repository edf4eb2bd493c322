"""Nearest points by brute force in double precision: every point against every triangle, in world space.

By regions (Ericson, Real-Time Collision Detection, 5.1.5): another way than the engine's.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]


def _dot(a: F64, b: F64) -> F64:
    return np.einsum("...k,...k->...", a, b)


def distances_to_triangles(points: npt.ArrayLike, corners: npt.ArrayLike) -> F64:
    """Points (P, 3), corners (T, 3, 3) -> (P, T) distances."""
    p = np.asarray(points, np.float64)[:, None]
    a, b, c = (np.asarray(corners, np.float64)[None, :, k] for k in range(3))
    nearest = np.full((p.shape[0], a.shape[1]), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        length = _dot(edge, edge)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(length > 0.0, _dot(p - start, edge) / length, 0.0)
        foot = start + np.clip(share, 0.0, 1.0)[..., None] * edge
        nearest = np.minimum(nearest, np.linalg.norm(p - foot, axis=-1))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=-1)
    inside = area > 0.0
    for start, end in ((a, b), (b, c), (c, a)):
        inside = inside & (_dot(np.cross(normal, end - start), p - start) >= 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        height = np.abs(_dot(normal, p - a)) / area
    return np.where(inside, np.minimum(nearest, height), nearest)
