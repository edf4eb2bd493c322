"""Almost nothing to split, or nothing to split by."""

from __future__ import annotations

import numpy as np

from .case import FailureCase, State, body, one, rays_around
from .shapes import gravel, joined, loose


def identical_centroids() -> tuple[State, ...]:
    """Triangles of many sizes whose boxes share their centre, many of them twice, one of them 300 times."""
    random = np.random.default_rng(10)
    first = random.normal(size=(500, 3))
    corners = np.stack([first, -first, first * random.uniform(-0.9, 0.9, (500, 3))], axis=1)
    return one(joined(loose(corners), loose(corners[:200]), loose(np.repeat(corners[:1], 300, axis=0))))


def few_triangles() -> tuple[State, ...]:
    """None, one, two, three, four and five triangles, one after the other."""
    positions, triangles = gravel(5, 11, 0.8)
    return tuple((body("Mesh", (positions[: 3 * count], triangles[:count])),) for count in range(6))


IDENTICAL_CENTROIDS = FailureCase(
    "identical_centroids",
    "Identical centroids, duplicates",
    "A plane through the middle of the centroids leaves all on one side: splitting never ends, or the stack does.",
    "tinybvh 138, 164",
    "Where no plane parts them they are halved in order; depth is bounded.",
    identical_centroids,
    rays_around,
)
FEW_TRIANGLES = FailureCase(
    "few_triangles",
    "None, one, up to five triangles",
    "A tree without a root, a root that is a leaf, nodes with fewer children than slots.",
    "tinybvh 138, 164",
    "Empty trees and single leaves are trees like any other, in every builder.",
    few_triangles,
    rays_around,
)
CASES = (IDENTICAL_CENTROIDS, FEW_TRIANGLES)
