"""A mesh with a color at each vertex, as if lit from above: an object beside its boxes. Knows no Blender."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...sync.records import MeshRecord

Float32Array = npt.NDArray[np.float32]

# More take long to hand to a graphics card; boxes are shown without the object then.
MOST_TRIANGLES = 1_000_000
LIGHT = np.array([0.35, -0.5, 0.8]) / np.linalg.norm([0.35, -0.5, 0.8])
# Of what light does not reach, and of what faces it.
DARKEST, BRIGHTEST = 0.22, 0.7


@dataclass(frozen=True, slots=True)
class ShadedMesh:
    """positions: (V, 3) float32. colors: (V, 4) float32 RGBA. triangles: (T, 3) int32."""

    positions: Float32Array
    colors: Float32Array
    triangles: npt.NDArray[np.int32]


def shade(mesh: MeshRecord) -> ShadedMesh | None:
    """None if there are more triangles than can be drawn."""
    if len(mesh.triangles) > MOST_TRIANGLES:
        return None
    positions = mesh.positions.astype(np.float64)
    corners = positions[mesh.triangles]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.empty_like(positions)
    for axis in range(3):
        of_corners = np.repeat(areas[:, axis], 3)
        normals[:, axis] = np.bincount(mesh.triangles.ravel(), of_corners, minlength=len(positions))
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    facing = (normals / np.where(lengths > 0.0, lengths, 1.0)) @ LIGHT
    grey = DARKEST + (BRIGHTEST - DARKEST) * (0.5 + 0.5 * facing)
    colors = np.ones((len(positions), 4), np.float32)
    colors[:, :3] = grey[:, None]
    return ShadedMesh(mesh.positions.astype(np.float32), colors, np.ascontiguousarray(mesh.triangles, np.int32))
