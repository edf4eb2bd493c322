"""A few thousand rays that trees are tried with, the same ones whenever the box is the same. Knows no Blender.

Primary rays go as a camera's do: from one point, side by side. Diffuse ones go as light does: from where those have
met something on into any direction, weighted by the cosine.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from perfect_bvh import Snapshot

Float64Array = npt.NDArray[np.float64]
Rays = tuple[Float64Array, Float64Array]

SIDE = 64  # rays in a row, and rows
TOWARDS = np.array([0.53, 0.75, -0.39])  # from above, aslant to all axes


@dataclass(frozen=True, slots=True)
class RayCost:
    """What a ray has met in the mean. nodes: of the trees that rays are traced through."""

    nodes: float
    triangles: float


def primary_rays(lower: npt.ArrayLike, upper: npt.ArrayLike) -> Rays:
    """Origins and directions (R, 3), from outside of a box at all of it. lower, upper: (3,)."""
    low, high = np.asarray(lower, np.float64), np.asarray(upper, np.float64)
    middle, radius = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-12)
    towards = TOWARDS / np.linalg.norm(TOWARDS)
    across = np.cross(towards, (0.0, 0.0, 1.0))
    across /= np.linalg.norm(across)
    up = np.cross(across, towards)
    half = (high - low) / 2
    width, height = np.abs(across) @ half, np.abs(up) @ half
    steps = (np.arange(SIDE) + 0.5) / SIDE * 2.0 - 1.0
    x, y = (values.reshape(-1, 1) for values in np.meshgrid(steps, steps))
    targets = middle + x * (width * across) + y * (height * up)
    origins = np.broadcast_to(middle - 4.0 * radius * towards, targets.shape)
    return np.ascontiguousarray(origins), targets - origins


def diffuse_rays(snapshot: Snapshot, primary: Rays) -> Rays | None:
    """As many, from what primary rays meet; None if that is nothing. Ask one snapshot, and cast them in many."""
    hits = snapshot.cast_rays(*primary, fields=("t_hit", "positions", "geometric_normals"))
    rows = np.flatnonzero(np.isfinite(hits.t_hit))
    if not len(rows):
        return None
    rows = np.resize(rows, len(primary[0]))
    normals = hits.geometric_normals[rows].astype(np.float64)
    normals *= np.where(np.einsum("ij,ij->i", normals, primary[1][rows]) > 0.0, -1.0, 1.0)[:, None]
    starts = hits.positions[rows].astype(np.float64)
    reach = float(np.abs(starts).max() + np.ptp(starts))
    around = np.random.default_rng(5).normal(size=normals.shape)
    bounced = around / np.linalg.norm(around, axis=-1, keepdims=True) + 1.0001 * normals
    return starts + 1e-5 * reach * normals, bounced


def cost_of(snapshot: Snapshot, rays: Rays) -> RayCost:
    """As the engine counts."""
    hits = snapshot.cast_rays(*rays, fields=("t_hit", "nodes_visited", "primitives_tested"))
    return RayCost(float(hits.nodes_visited.mean()), float(hits.primitives_tested.mean()))
