"""Tangents of a mesh along a uv map, for normal maps, as Cycles computes them.

MikkTSpace on triangles (Mikkelsen 2008, "Simulation of Wrinkled Surfaces Revisited", section 5).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Float32Array = npt.NDArray[np.float32]
Floats = npt.NDArray[np.float64]


def corner_tangents(corners: Float32Array, normals: Float32Array | None, uvs: Float32Array) -> Float32Array:
    """(T, 3, 4) float32: the unit tangent of each corner in object space, and the bitangent's sign.

    Corners at one place with one normal, one uv and triangles of one orientation share their tangent.

    Args:
        corners: (T, 3, 3), positions.
        normals: (T, 3, 3), of the corners; None for a mesh of flat faces.
        uvs: (T, 3, 2).
    """
    places = corners.astype(np.float64)
    sides, uv_sides = places[:, 1:] - places[:, :1], np.float64(uvs[:, 1:]) - uvs[:, :1]
    flat = _unit(np.cross(sides[:, 0], sides[:, 1]))
    up = np.repeat(flat[:, None], 3, axis=1) if normals is None else _unit(normals.astype(np.float64))
    area = uv_sides[:, 0, 0] * uv_sides[:, 1, 1] - uv_sides[:, 0, 1] * uv_sides[:, 1, 0]
    sign = np.where(area > 0.0, 1.0, -1.0)
    along = sides[:, 0] * uv_sides[:, 1, 1, None] - sides[:, 1] * uv_sides[:, 0, 1, None]
    tangents = _unit(_projected((_unit(along) * sign[:, None])[:, None], up))
    weighted = tangents * (_angles(places, up) * (area != 0.0)[:, None])[:, :, None]

    sums = np.zeros((len(places) * 3, 3))
    owners = _shared(corners, np.float32(up), uvs, sign)
    for axis in range(3):
        sums[:, axis] = np.bincount(owners, weighted[..., axis].ravel(), minlength=len(sums))
    shared = _unit(sums[owners])
    missing = ~shared.any(axis=1)
    shared[missing] = _any_across(up.reshape(-1, 3)[missing])
    return np.concatenate(
        [shared.reshape(-1, 3, 3), np.broadcast_to(sign[:, None, None], (len(sign), 3, 1))], axis=2
    ).astype(np.float32)


def _shared(corners: Float32Array, up: Float32Array, uvs: Float32Array, sign: Floats) -> npt.NDArray[np.intp]:
    """(3 T,): a number that corners have in common which share their tangent."""
    rows = np.empty((len(corners) * 3, 9), np.float32)
    rows[:, :3], rows[:, 3:6], rows[:, 6:8] = corners.reshape(-1, 3), up.reshape(-1, 3), uvs.reshape(-1, 2)
    rows[:, 8] = np.repeat(sign, 3)
    rows += 0.0  # no minus zero
    keys = np.ascontiguousarray(rows).view(np.dtype((np.void, rows.dtype.itemsize * 9))).ravel()
    owners: npt.NDArray[np.intp] = np.unique(keys, return_inverse=True)[1]
    return owners.reshape(-1)


def _angles(places: Floats, up: Floats) -> Floats:
    """(T, 3): between the sides at each corner, seen along its normal."""
    before = _unit(_projected(np.roll(places, 1, axis=1) - places, up))
    after = _unit(_projected(np.roll(places, -1, axis=1) - places, up))
    angles: Floats = np.arccos(np.clip(np.einsum("tci,tci->tc", before, after), -1.0, 1.0))
    return angles


def _projected(vectors: Floats, up: Floats) -> Floats:
    """Returns the components of vectors perpendicular to a normal."""
    return vectors - up * np.einsum("...i,...i->...", vectors, up)[..., None]


def _any_across(up: Floats) -> Floats:
    least = np.eye(3)[np.argmin(np.abs(up), axis=1)]
    return _unit(np.cross(up, least))


def _unit(vectors: Any) -> Floats:
    """Zero for those without a length."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0)
