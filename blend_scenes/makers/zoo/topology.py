"""Different triangles over the same number of vertices: counts hide the change, and a refit must reject it."""

from __future__ import annotations

import numpy as np

from .case import FailureCase, State, body, rays_around
from .shapes import Mesh, ball, sheet


def _hills() -> Mesh:
    positions, triangles = sheet(20)
    x, y, _ = positions.T
    return np.stack([x, y, 0.25 * np.sin(7.0 * x) * np.cos(5.0 * y)], axis=1), triangles


def equal_counts() -> tuple[State, ...]:
    """Hills whose squares are cut along the other diagonal, then renumbered: V and T stay the same."""
    positions, triangles = _hills()
    pairs = triangles.reshape(-1, 2, 3)
    a, b, c, d = pairs[:, 0, 0], pairs[:, 0, 1], pairs[:, 0, 2], pairs[:, 1, 2]
    other = np.stack([np.stack([a, b, d], axis=1), np.stack([b, c, d], axis=1)], axis=1).reshape(-1, 3)
    order = np.random.default_rng(18).permutation(len(triangles))
    forms = (triangles, other, other[order])
    return tuple((body("Mesh", (positions, form)),) for form in forms)


def topology_on_some_frames() -> tuple[State, ...]:
    """A ball that breathes; on the third and fifth of six frames its triangles are dealt out again."""
    positions, triangles = ball(3)
    dealt = triangles[np.random.default_rng(19).permutation(len(triangles))][:, [1, 2, 0]]
    other = {2: (_swapped(positions), dealt), 4: (positions, triangles[::-1].copy())}
    frames = []
    for frame in range(6):
        points, form = other.get(frame, (positions, triangles))
        frames.append((body("Mesh", (points * (1.0 + 0.1 * frame), form)),))
    return tuple(frames)


def _swapped(positions: np.ndarray) -> np.ndarray:
    return positions[:, [1, 2, 0]]


EQUAL_COUNTS = FailureCase(
    "equal_counts",
    "Other triangles at equal counts",
    "A refit is taken for enough because as many vertices and triangles came as before: rays meet the old triangles.",
    "classic",
    "Sync compares the triangles themselves, never their number.",
    equal_counts,
    rays_around,
)
TOPOLOGY_ON_SOME_FRAMES = FailureCase(
    "topology_on_some_frames",
    "Topology that changes on some frames only",
    "A mesh that was seen to keep its triangles for a while is refitted on the frame on which it does not.",
    "modifiers that switch",
    "Sync compares the triangles on every frame.",
    topology_on_some_frames,
    rays_around,
)
CASES = (EQUAL_COUNTS, TOPOLOGY_ON_SOME_FRAMES)
