"""Möller and Trumbore's ray-triangle test (1997) in its usual form: float32 and an absolute epsilon."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

_PAIRS_AT_A_TIME = 1_000_000

Float32Array = npt.NDArray[np.float32]
Int64Array = npt.NDArray[np.int64]


def closest_hits(
    corners: npt.ArrayLike,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    epsilon: float = 1e-8,
    fused: bool = False,
    dtype: type[np.floating] = np.float32,
) -> tuple[Float32Array, Int64Array]:
    """Each ray's t (R,), inf on a miss, and row (R,) of the triangles (T, 3, 3), -1 on a miss, by trying them all.

    epsilon: a determinant no larger is taken for a ray in the plane. fused: no rounding between a product and
    its sum (of float32). dtype: of the calculation.
    """
    triangles, starts, ways = (np.asarray(values, dtype) for values in (corners, origins, directions))
    t_hit, rows = np.full(len(starts), np.inf, dtype), np.full(len(starts), -1, np.int64)
    if len(triangles) == 0:
        return t_hit, rows
    step = max(1, _PAIRS_AT_A_TIME // len(triangles))
    for start in range(0, len(starts), step):
        part = slice(start, start + step)
        t = _distances(triangles, starts[part], ways[part], dtype(epsilon), fused)
        rows[part] = np.argmin(t, axis=1)
        t_hit[part] = np.take_along_axis(t, rows[part, None], axis=1)[:, 0]
    rows[~np.isfinite(t_hit)] = -1
    return t_hit, rows


def _distances(
    triangles: Float32Array, origins: Float32Array, directions: Float32Array, epsilon: np.floating, fused: bool
) -> Float32Array:
    """Every ray's (R) t with every triangle (T), inf where there is no hit."""
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    with np.errstate(all="ignore"):
        p = _cross(directions[:, None], second[None], fused)
        determinant = _dot(p, first[None], fused)
        inverse = 1 / determinant
        s = origins[:, None] - triangles[None, :, 0]
        u = _dot(s, p, fused) * inverse
        q = _cross(s, first[None], fused)
        v = _dot(q, directions[:, None], fused) * inverse
        t = _dot(q, second[None], fused) * inverse
        hit = (np.abs(determinant) > epsilon) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    return np.where(hit, t, np.inf)


def _multiply_add(a: Float32Array, b: Float32Array, c: Float32Array, fused: bool) -> Float32Array:
    """The sum a * b + c; a product of two float32 is exact in float64."""
    if fused:
        return (a.astype(np.float64) * b + c).astype(np.float32)
    return a * b + c


def _dot(a: Float32Array, b: Float32Array, fused: bool) -> Float32Array:
    two = _multiply_add(a[..., 1], b[..., 1], a[..., 0] * b[..., 0], fused)
    return _multiply_add(a[..., 2], b[..., 2], two, fused)


def _cross(a: Float32Array, b: Float32Array, fused: bool) -> Float32Array:
    parts = []
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        parts.append(_multiply_add(a[..., i], b[..., j], -(a[..., j] * b[..., i]), fused))
    return np.stack(parts, axis=-1)
