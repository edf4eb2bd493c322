"""A ground of two triangles, as large as one likes, rays at its middle, and how far off the distances are."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from benchmarks.meshes import BenchMesh
from benchmarks.peers import Answers
from benchmarks.rays import Rays

MOST_OFF = 1e-6  # of t: float32 itself is 6e-8 off
SIDES = tuple(10.0**power for power in range(1, 7))
F64 = npt.NDArray[np.float64]


def ground(side: float, is_aslant: bool) -> BenchMesh:
    """A square about the origin, in the plane z = 0 or turned out of it."""
    flat = side / 2.0 * np.array([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)])
    positions = (flat @ _turn(is_aslant).T).astype(np.float32)
    return BenchMesh("ground", positions, np.array([(0, 1, 2), (0, 2, 3)], np.int32), is_inside=True)


def rays_at_its_middle(count: int, is_aslant: bool) -> Rays:
    """Rays from one to three units above the ground to the ten by ten in its middle."""
    random = np.random.default_rng(29)
    origins = np.column_stack([random.uniform(-5.0, 5.0, (count, 2)), random.uniform(1.0, 3.0, count)])
    targets = np.column_stack([random.uniform(-5.0, 5.0, (count, 2)), np.zeros(count)])
    turn = _turn(is_aslant)
    return Rays("ground", *((rows @ turn.T).astype(np.float32) for rows in (origins, targets - origins)))


def errors_of_t(mesh: BenchMesh, rays: Rays, answers: Answers) -> dict[str, float]:
    """How far t is from where the triangle's plane is met, as a share of that; misses are counted apart.

    off_per_million: of the rays that hit, those whose t is off by more than MOST_OFF.
    """
    t, rows = answers.t, answers.primitive_ids
    found = rows >= 0
    a, b, c = (mesh.positions.astype(np.float64)[mesh.triangles[rows[found], corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    origins, directions = (each[: len(t)][found].astype(np.float64) for each in (rays.origins, rays.directions))
    exact = ((a - origins) * normals).sum(axis=1) / (directions * normals).sum(axis=1)
    off = np.abs(t[found] / exact - 1.0)
    spread = {"median": float(np.median(off)), "largest": float(off.max())}
    return {
        "rays": len(t),
        "missed": int((~found).sum()),
        "off_per_million": 1e6 * float(np.mean(off > MOST_OFF)),
        **spread,
    }


def _turn(is_aslant: bool) -> F64:
    """Rotates by fixed angles about x and y, so that none of the plane's coordinates is zero."""
    if not is_aslant:
        return np.eye(3)
    (s, c), (p, q) = ((np.sin(angle), np.cos(angle)) for angle in (0.3, 0.2))
    return np.array([(1.0, 0.0, 0.0), (0.0, c, -s), (0.0, s, c)]) @ np.array(
        [(q, 0.0, p), (0.0, 1.0, 0.0), (-p, 0.0, q)]
    )
