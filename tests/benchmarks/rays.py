"""The rays that are cast at a mesh, as in native/benchmarks/ray_sets.h.

Primary rays of a camera; diffuse bounces from where those hit, in the order of the pixels; the same shuffled; and
ambient occlusion within a tenth of the mesh's diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import perfect_bvh
from benchmarks.meshes import BenchMesh

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Rays:
    """origins, directions: (R, 3) float32. t_max: of all. is_any_hit: whether only a hit or a miss is asked for."""

    name: str
    origins: F32
    directions: F32
    t_max: float = np.inf
    is_any_hit: bool = False

    def __len__(self) -> int:
        return len(self.origins)

    def pick(self, rows: slice | npt.NDArray[np.intp]) -> Rays:
        return replace(self, origins=self.origins[rows], directions=self.directions[rows])


def make_rays(mesh: BenchMesh, width: int, height: int) -> list[Rays]:
    """Primary, diffuse, shuffled and occlusion rays. The bounces start where the primary rays hit."""
    random = np.random.default_rng(3)
    lower, upper = mesh.positions.min(axis=0).astype(np.float64), mesh.positions.max(axis=0).astype(np.float64)
    diagonal = float(np.linalg.norm(upper - lower))
    primary = camera_rays("primary", lower, upper, mesh.is_inside, width, height, random)
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(mesh.positions, mesh.triangles))
    scene.commit()
    hits = scene.cast_rays(primary.origins, primary.directions, fields=("t_hit", "geometric_normals", "positions"))
    rows = np.isfinite(hits.t_hit) & (np.linalg.norm(hits.geometric_normals, axis=1) > 0.5)
    normals = hits.geometric_normals[rows].astype(np.float64)
    facing = np.einsum("ij,ij->i", normals, primary.directions[rows])
    normals[facing > 0.0] *= -1.0
    origins = (hits.positions[rows] + 1e-4 * diagonal * normals).astype(np.float32)
    diffuse = Rays("diffuse", origins, _cosine(normals, random))
    occlusion = Rays("occlusion", origins, _cosine(normals, random), 0.1 * diagonal, is_any_hit=True)
    shuffled = replace(diffuse.pick(random.permutation(len(diffuse))), name="shuffled")
    return [rays for rays in (primary, diffuse, shuffled, occlusion) if len(rays)]


def _unit(vectors: F64) -> F64:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def camera_rays(
    name: str, lower: F64, upper: F64, is_inside: bool, width: int, height: int, random: np.random.Generator
) -> Rays:
    """One ray a pixel of a camera that frames a box, or is inside it."""
    centre, extent = 0.5 * (lower + upper), upper - lower
    diagonal, half_height = float(np.linalg.norm(extent)), 0.42
    eye, target = centre + _unit(np.array([0.5, 0.25, 1.0])) * diagonal, centre
    if is_inside:
        eye = centre + (0.25 * diagonal, -0.2 * extent[1], 0.0)
        target, half_height = centre - (0.2 * diagonal, 0.0, 0.02 * diagonal), 0.7
    forward = _unit(target - eye)
    right = _unit(np.cross(forward, (0.0, 1.0, 0.0)))
    upward = np.cross(right, forward)
    y, x = np.mgrid[0:height, 0:width].reshape(2, -1)
    across = ((x + random.random(x.shape)) / width * 2.0 - 1.0) * half_height * width / height
    above = (1.0 - (y + random.random(y.shape)) / height * 2.0) * half_height
    directions = _unit(forward + across[:, None] * right + above[:, None] * upward).astype(np.float32)
    return Rays(name, np.tile(eye.astype(np.float32), (len(directions), 1)), directions)


def _cosine(normals: F64, random: np.random.Generator) -> F32:
    """Cosine-weighted about the normals: a point on the unit sphere around their tips."""
    points = _unit(random.normal(size=normals.shape))
    return _unit(points + 1.0001 * normals).astype(np.float32)
