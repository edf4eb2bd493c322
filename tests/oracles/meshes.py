"""Small seeded meshes for tests: (positions, triangles); and places for their instances."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Mesh = tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]


def sphere(rings: int, segments: int, radius: float = 1.0, centre: npt.ArrayLike = (0.0, 0.0, 0.0)) -> Mesh:
    """A closed sphere of 2 * segments * (rings - 1) triangles, facing outward; its poles are single vertices."""
    polar = np.pi * np.arange(1, rings) / rings
    turn = 2.0 * np.pi * np.arange(segments) / segments
    ring = np.stack(
        [
            np.outer(np.sin(polar), np.cos(turn)),
            np.outer(np.sin(polar), np.sin(turn)),
            np.outer(np.cos(polar), np.ones(segments)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    positions = np.concatenate([[(0.0, 0.0, 1.0)], ring, [(0.0, 0.0, -1.0)]])
    last = len(positions) - 1
    here = np.arange(segments)
    there = (here + 1) % segments
    faces = [np.stack([np.zeros_like(here), 1 + here, 1 + there], axis=1)]
    for row in range(rings - 2):
        upper, lower = 1 + row * segments, 1 + (row + 1) * segments
        faces.append(np.stack([upper + here, lower + here, lower + there], axis=1))
        faces.append(np.stack([upper + here, lower + there, upper + there], axis=1))
    bottom = 1 + (rings - 2) * segments
    faces.append(np.stack([np.full_like(here, last), bottom + there, bottom + here], axis=1))
    return positions * radius + np.asarray(centre), np.concatenate(faces).astype(np.int32)


def soup(count: int, seed: int, size: float = 0.3) -> Mesh:
    """Unconnected random triangles in the unit cube."""
    random = np.random.default_rng(seed)
    centres = random.uniform(-1.0, 1.0, (count, 1, 3))
    corners = centres + random.normal(0.0, size, (count, 3, 3))
    return corners.reshape(-1, 3), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def slivers(count: int, seed: int) -> Mesh:
    """Long thin triangles, aspect up to 1e5."""
    random = np.random.default_rng(seed)
    start = random.uniform(-1.0, 1.0, (count, 3))
    along = random.normal(0.0, 1.0, (count, 3))
    across = random.normal(0.0, 1.0, (count, 3)) * 10.0 ** random.uniform(-5.0, -1.0, (count, 1))
    corners = np.stack([start, start + along, start + across], axis=1)
    return corners.reshape(-1, 3), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def grid(cells: int, size: float = 1.0) -> Mesh:
    """A flat square in the plane z = 0, from -size to size, facing up; vertices on representable numbers."""
    line = np.linspace(-size, size, cells + 1)
    x, y = np.meshgrid(line, line)
    positions = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)[None, :]).ravel()
    lower = np.stack([corner, corner + 1, corner + cells + 2], axis=1)
    upper = np.stack([corner, corner + cells + 2, corner + cells + 1], axis=1)
    return positions, np.concatenate([lower, upper]).astype(np.int32)


def random_rays(count: int, seed: int, reach: float = 2.5) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Rays from around and inside the unit cube, towards points in it; directions of any length."""
    random = np.random.default_rng(seed)
    origins = random.uniform(-reach, reach, (count, 3)).astype(np.float32)
    targets = random.uniform(-1.0, 1.0, (count, 3))
    lengths = 10.0 ** random.uniform(-2.0, 2.0, (count, 1))
    return origins, ((targets - origins) * lengths).astype(np.float32)


def scattered(count: int, reach: float, seed: int) -> npt.NDArray[np.float64]:
    """Transforms (N, 4, 4) of instances placed anywhere from -reach to reach along each axis, not turned."""
    places = np.tile(np.eye(4), (count, 1, 1))
    places[:, :3, 3] = np.random.default_rng(seed).uniform(-reach, reach, (count, 3))
    return places
