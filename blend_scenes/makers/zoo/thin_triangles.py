"""Long thin triangles: their boxes are mostly empty, and their edges are where rounding decides."""

from __future__ import annotations

import numpy as np

from .case import FailureCase, Rays, State, one, rays_around, world_corners
from .shapes import loose


def diagonal_sticks() -> tuple[State, ...]:
    """Straws of two triangles, three times as long as the cube is wide, all more or less along its diagonal."""
    random = np.random.default_rng(6)
    along = 1.0 + random.normal(0.0, 0.3, (700, 3))
    along *= 3.0 / np.linalg.norm(along, axis=1, keepdims=True)
    start = random.uniform(-1.0, 1.0, (700, 3)) - along / 2
    across = np.cross(along, random.normal(size=(700, 3)))
    across *= 0.004 / np.linalg.norm(across, axis=1, keepdims=True)
    first = np.stack([start, start + along, start + across], axis=1)
    second = np.stack([start + along, start + along + across, start + across], axis=1)
    return one(loose(np.concatenate([first, second])))


def hair_in_wind() -> tuple[State, ...]:
    """Two thousand hairs on a ball, of four long straight parts each, all blown the same way."""
    random = np.random.default_rng(8)
    way = random.normal(size=(2000, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    points = [way]
    for _ in range(4):
        way = way / 2 + (0.4, 0.25, -0.175) + random.normal(0.0, 0.15, (2000, 3))
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        points.append(points[-1] + way)
    one_side = np.stack(points, axis=1)
    across = np.cross(np.diff(one_side, axis=1), random.normal(size=(2000, 1, 3)))
    across *= 0.004 / np.linalg.norm(across, axis=-1, keepdims=True)
    other_side = one_side + np.concatenate([across, across[:, -1:]], axis=1)
    first = np.stack([one_side[:, :-1], one_side[:, 1:], other_side[:, :-1]], axis=2)
    second = np.stack([one_side[:, 1:], other_side[:, 1:], other_side[:, :-1]], axis=2)
    return one(loose(np.concatenate([first, second], axis=1)))


def grazed_slivers() -> tuple[State, ...]:
    """Triangles of an aspect up to 1e5."""
    random = np.random.default_rng(7)
    start = random.uniform(-1.0, 1.0, (600, 3))
    along = random.normal(size=(600, 3))
    across = random.normal(size=(600, 3)) * 10.0 ** random.uniform(-5.0, -2.0, (600, 1))
    return one(loose(np.stack([start, start + along, start + across], axis=1)))


def grazing_rays(state: State, count: int, seed: int) -> Rays:
    """Towards points on the triangles from thirty units away, half a degree out of their planes."""
    random = np.random.default_rng(seed)
    corners = world_corners(state)
    chosen = corners[random.integers(0, len(corners), count)]
    targets = np.einsum("rc,rck->rk", random.dirichlet((1.0, 1.0, 1.0), count), chosen)
    within = chosen[:, 1] - chosen[:, 0]
    within /= np.linalg.norm(within, axis=1, keepdims=True)
    normals = np.cross(chosen[:, 1] - chosen[:, 0], chosen[:, 2] - chosen[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    turn = random.uniform(0.0, 2.0 * np.pi, (count, 1))
    flat = np.cos(turn) * within + np.sin(turn) * np.cross(normals, within)
    directions = np.cos(np.radians(0.5)) * flat + np.sin(np.radians(0.5)) * normals
    return targets - 30.0 * directions, directions


DIAGONAL_STICKS = FailureCase(
    "diagonal_sticks",
    "Sticks aslant",
    "Object splits: every box is nearly as large as its parent, however the sticks are shared out.",
    "Stich, Friedrich and Dietrich 2009",
    '`builder="spatial"` cuts the sticks themselves. The planner takes it where the expected rays repay it.',
    diagonal_sticks,
    rays_around,
)
HAIR_IN_WIND = FailureCase(
    "hair_in_wind",
    "Hair in the wind",
    "Object splits: hairs that lie aslant through one another have boxes of mostly air, which all overlap.",
    "Stich, Friedrich and Dietrich 2009",
    '`builder="spatial"` cuts the hairs themselves. The planner takes it where the expected rays repay it.',
    hair_in_wind,
    rays_around,
    grid=2.0**-12,
    is_loose=True,
)
GRAZED_SLIVERS = FailureCase(
    "grazed_slivers",
    "Slivers grazed at half a degree",
    "The determinant of a thin triangle seen almost edge-on is mostly rounding: lost hits, false hits, t far off.",
    "embree 387",
    "Edge functions whose sign and value are right (Woop, Benthin and Wald 2013; Kahan).",
    grazed_slivers,
    grazing_rays,
)
CASES = (DIAGONAL_STICKS, HAIR_IN_WIND, GRAZED_SLIVERS)
