"""Which triangles the line of a ray meets, in exact arithmetic: edges and vertices count, rays in the plane do not.

The signs of the triple products d . (p x q) decide, with p and q two corners as seen from the origin. Doubles with a
bound on their error settle most of them, whole numbers of any size the others. No tree, no code of the engine.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]
BOUND = 16 * 2.0**-53  # of each product's size: three roundings of each corner's coordinates, five of the sum
PAIRS_AT_ONCE = 400_000


def lines_meet(
    positions: npt.NDArray[np.float32], triangles: npt.NDArray[np.integer], origins: F64, directions: F64
) -> npt.NDArray[np.bool_]:
    """Return (rays, triangles): True where the line of a ray meets a triangle."""
    corners = positions.astype(np.float64)[triangles]
    met = np.empty((len(origins), len(triangles)), bool)
    step = max(1, PAIRS_AT_ONCE // len(triangles))
    for first in range(0, len(origins), step):
        rows = slice(first, first + step)
        met[rows] = _meet(corners, origins[rows], directions[rows])
    return met


def plane_distances(
    positions: npt.NDArray[np.float32], triangles: npt.NDArray[np.integer], origins: F64, directions: F64
) -> F64:
    """Return (rays, triangles): t of each triangle's plane, in extended precision where the machine has it."""
    corners = positions.astype(np.longdouble)[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    away = (normals * corners[:, 0]).sum(-1) - origins.astype(np.longdouble) @ normals.T
    with np.errstate(divide="ignore", invalid="ignore"):
        return away / (directions.astype(np.longdouble) @ normals.T)


def _meet(corners: F64, origins: F64, directions: F64) -> npt.NDArray[np.bool_]:
    seen = corners[None] - origins[:, None, None]  # (R, T, 3 corners, 3)
    signs = np.empty(seen.shape[:3], np.int8)
    near = _passes_near(seen, directions)
    for side in range(3):
        p, q = seen[:, :, side], seen[:, :, (side + 1) % 3]
        product = np.zeros(seen.shape[:2])
        size = np.zeros(seen.shape[:2])
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            first, second = p[..., j] * q[..., k], p[..., k] * q[..., j]
            product += directions[:, None, i] * (first - second)
            size += np.abs(directions[:, None, i]) * (np.abs(first) + np.abs(second))
        signs[..., side] = np.sign(product)
        has_side = (corners[:, side] != corners[:, (side + 1) % 3]).any(axis=-1)  # without, the product is zero
        signs[..., side] *= has_side
        for ray, triangle in zip(*np.nonzero((np.abs(product) <= BOUND * size) & near & has_side), strict=True):
            a, b = corners[triangle, side], corners[triangle, (side + 1) % 3]
            signs[ray, triangle, side] = _exact_sign(origins[ray], directions[ray], a, b)
    return near & ((signs >= 0).all(-1) | (signs <= 0).all(-1)) & (signs != 0).any(-1)


def _passes_near(seen: F64, directions: F64) -> npt.NDArray[np.bool_]:
    """Return (rays, triangles): False where a line passes a ball around the triangle by more than doubles round."""
    centres = seen.mean(axis=2)
    radii = np.linalg.norm(seen - centres[:, :, None], axis=-1).max(axis=-1)
    moments = np.linalg.norm(np.cross(centres, directions[:, None]), axis=-1)
    distances = moments / np.linalg.norm(directions, axis=-1)[:, None]
    return distances <= radii * 1.001 + 1e-12 * np.linalg.norm(centres, axis=-1)


def _exact_sign(origin: F64, direction: F64, a: F64, b: F64) -> int:
    o, *corners = _whole(origin, a, b)
    (d,) = _whole(direction)
    (px, py, pz), (qx, qy, qz) = ([x - y for x, y in zip(corner, o, strict=True)] for corner in corners)
    product = d[0] * (py * qz - pz * qy) + d[1] * (pz * qx - px * qz) + d[2] * (px * qy - py * qx)
    return (product > 0) - (product < 0)


def _whole(*vectors: F64) -> list[list[int]]:
    """Return the numbers times one power of two that makes all of them whole."""
    ratios = [[x.as_integer_ratio() for x in vector.tolist()] for vector in vectors]
    largest = max([denominator for vector in ratios for _, denominator in vector])
    return [[numerator * (largest // denominator) for numerator, denominator in vector] for vector in ratios]
