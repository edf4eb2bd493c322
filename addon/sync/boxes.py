"""The box around each instance along its object's own axes, in world space."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from .records import Float64Array, MeshRecord, SceneRecord

# (8, 3): of the unit cube about the origin.
_CORNERS = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5], indexing="ij")).reshape(3, 8).T


class Boxes(NamedTuple):
    """N oriented boxes in world space.

    centers: (N, 3) float64. sizes: (N, 3) float64, along the axes. axes: (N, 3, 3) float64, rows are unit vectors of
    the object's x, y and z; not at right angles if the object is sheared.
    """

    centers: Float64Array
    sizes: Float64Array
    axes: Float64Array

    def corners(self) -> Float64Array:
        """Return (N, 8, 3) float64."""
        found: Float64Array = self.centers[:, None] + (_CORNERS * self.sizes[:, None]) @ self.axes
        return found


def boxes_of(record: SceneRecord, rows: npt.NDArray[Any]) -> Boxes:
    """Find the boxes of (N,) instances by their rows."""
    transforms, meshes = record.instances.transforms[rows].astype(np.float64), record.instances.mesh_indices[rows]
    shown, places = np.unique(meshes, return_inverse=True)
    bounds = np.array([_bounds_of(record.meshes[row]) for row in shown.tolist()]).reshape(-1, 2, 3)[places.reshape(-1)]
    lengths = np.linalg.norm(transforms[:, :, :3], axis=1)
    axes = transforms[:, :, :3] / np.where(lengths > 0.0, lengths, 1.0)[:, None]
    centers = np.einsum("nij,nj->ni", transforms[:, :, :3], bounds.mean(axis=1)) + transforms[:, :, 3]
    return Boxes(centers, (bounds[:, 1] - bounds[:, 0]) * lengths, axes.transpose(0, 2, 1))


def _bounds_of(mesh: MeshRecord) -> Float64Array:
    """(2, 3): the least and the greatest coordinates of what rays may hit, in object space."""
    places = mesh.positions[mesh.triangles.reshape(-1)] if mesh.kind == "triangles" else mesh.positions
    reach = 0.0 if mesh.radii is None else mesh.radii[:, None].astype(np.float64)
    return np.array([(places - reach).min(axis=0), (places + reach).max(axis=0)], np.float64)
