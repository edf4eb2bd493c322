"""Detail that lies unevenly: where to split is not where half of the triangles or half of the space is."""

from __future__ import annotations

import numpy as np

from .case import FailureCase, Rays, State, one, rays_around, world_corners
from .shapes import ball, gravel, joined, loose, room, sheet

HALVINGS = 23


def teapot_in_stadium() -> tuple[State, ...]:
    return one(joined(room(500.0), ball(4, 0.5, (3.0, 2.0, -498.0))))


def ground_under_gravel() -> tuple[State, ...]:
    return one(joined(sheet(1, 100.0), gravel(2000, 3, 0.02, (3.0, 3.0, 0.2))))


def far_clusters() -> tuple[State, ...]:
    """Two swarms a thousand units apart, in one of which every triangle is a hundred times as large."""
    fine, coarse = gravel(1500, 4, 0.02), gravel(500, 5, 2.0, 8.0)
    return one(joined(fine, (coarse[0] + (1000.0, 50.0, 0.0), coarse[1])))


def nested_boxes() -> tuple[State, ...]:
    """A hundred thousand triangles in boxes about one corner, 4,170 in each, each box half as wide as the last."""
    random = np.random.default_rng(11)
    corners = random.uniform(0.0, 1.0, (4170, 1, 3)) + random.normal(0.0, 0.02, (4170, 3, 3))
    sizes = 0.5 ** np.arange(1 + HALVINGS)
    return one(loose(sizes[:, None, None, None] * corners))


def rays_at_each_size(state: State, count: int, seed: int) -> Rays:
    """Towards points on the triangles, from as far away as the triangle is large."""
    random = np.random.default_rng(seed)
    corners = world_corners(state)
    chosen = corners[random.integers(0, len(corners), count)]
    targets = np.einsum("rc,rck->rk", random.dirichlet((1.0, 1.0, 1.0), count), chosen)
    directions = random.normal(size=(count, 3)) * np.abs(chosen).max(axis=(1, 2))[:, None]
    return targets - directions, directions


TEAPOT_IN_STADIUM = FailureCase(
    "teapot_in_stadium",
    "Teapot in a stadium",
    "Halves of equal number or equal width: the detail is a thousandth of the hall, and most splits are wasted.",
    "classic",
    "Splits by surface area (MacDonald and Booth 1990), in every builder but `median`.",
    teapot_in_stadium,
    rays_around,
    view=((0.5, -1.5, -496.5), (3.0, 2.0, -498.0)),
)
GROUND_UNDER_GRAVEL = FailureCase(
    "ground_under_gravel",
    "Large ground under gravel",
    "Object splits: wherever the ground's two triangles go, their box covers all the others.",
    "classic",
    "Surface area sends the ground up the tree at once; `spatial` cuts it as well.",
    ground_under_gravel,
    rays_around,
    view=((4.0, -6.0, 3.0), (0.0, 0.0, 0.0)),
)
FAR_CLUSTERS = FailureCase(
    "far_clusters",
    "Two far clusters, two sizes",
    "A greedy choice of planes: bins as wide as the gap see no detail on either side.",
    "classic",
    "Bins are laid anew over each node's own centroids.",
    far_clusters,
    rays_around,
    view=((-3.5, 0.0, 0.5), (1000.0, 50.0, 0.0)),
)
NESTED_BOXES = FailureCase(
    "nested_boxes",
    "Boxes within boxes",
    "A stack of 64 entries: each split peels off one box, and the tree grows as deep as there are boxes.",
    "measured by reading a peer's source",
    "No builder makes a tree deeper than 96, and stacks are sized for it.",
    nested_boxes,
    rays_at_each_size,
    view=((1.9, 1.5, 1.7), (0.3, 0.3, 0.3)),
    halvings=HALVINGS,
)
CASES = (TEAPOT_IN_STADIUM, GROUND_UNDER_GRAVEL, FAR_CLUSTERS, NESTED_BOXES)
