"""Normals and uvs where rays met triangles, from what a sync has read of the meshes. Knows no Blender."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from ..sync.records import MeshRecord

Floats = npt.NDArray[np.float32]


def corner_values(
    meshes: tuple[MeshRecord, ...], name: str, mesh_rows: npt.NDArray[Any], primitives: npt.NDArray[Any], uvs: Floats
) -> tuple[Floats | None, npt.NDArray[np.bool_]]:
    """Values of triangles' corners at hits, and which hits have any.

    name: of a field of the meshes, (T, 3, C). mesh_rows, primitives: (R,), which triangle of which mesh was hit. uvs:
    (R, 2), where on it. Returns (R, C) float32, zero where a mesh has no such values, None if none of them has.
    """
    values: Floats | None = None
    found = np.zeros(len(mesh_rows), np.bool_)
    weights = np.column_stack([1.0 - uvs.sum(axis=1), uvs]).astype(np.float32)
    for row in np.unique(mesh_rows):
        corners = getattr(meshes[row], name)
        if corners is None or corners.ndim != 3:  # curves and points have one value each, and no corners
            continue
        hits = np.flatnonzero(mesh_rows == row)
        if values is None:
            values = np.zeros((len(mesh_rows), corners.shape[2]), np.float32)
        values[hits] = np.einsum("rk,rkc->rc", weights[hits], corners[primitives[hits]])
        found[hits] = True
    return values, found


def world_normals(
    normals: Floats, linear: npt.NDArray[np.float64], mirrored: npt.NDArray[np.bool_]
) -> npt.NDArray[np.float64]:
    """(R, 3) unit normals of (R, 3) in object space; linear: (R, 3, 3), object to world; mirrored: (R,), if it mirrors.

    By the cofactors, which are the inverse's transpose but for a factor, and are there for what is flattened, too.
    """
    x, y, z = (linear[:, :, axis] for axis in range(3))
    cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=2)
    turned = np.einsum("rij,rj->ri", cofactors, normals.astype(np.float64))
    turned *= np.where(mirrored, -1.0, 1.0)[:, None]
    size = np.linalg.norm(turned, axis=1, keepdims=True)
    return np.divide(turned, size, out=np.zeros_like(turned), where=size > 0.0)
