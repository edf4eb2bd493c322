"""Boxes without thickness, rays along the axes, and hits at edges: where 0 * inf and rounding come in."""

from __future__ import annotations

import numpy as np

from .case import FailureCase, Rays, State, one, points_on, world_corners
from .shapes import ball, joined, loose, room, sheet


def flat_boxes() -> tuple[State, ...]:
    """Sheets in the coordinate planes, with triangles of no area (a point, a line) among them."""
    floor = sheet(12)
    walls = [(floor[0][:, order], floor[1]) for order in ([2, 0, 1], [1, 2, 0])]
    at = sheet(6)[0][:40]
    points = loose(np.repeat(at[:, None], 3, axis=1))
    lines = loose(np.stack([at, at + np.array([0.1, 0.0, 0.0]), at + np.array([0.2, 0.0, 0.0])], axis=1))
    return one(joined(floor, *walls, points, lines))


def axis_parallel_rays() -> tuple[State, ...]:
    """A ball in a room whose corners, and so the planes of boxes, are where the rays begin."""
    return one(joined(room(2.0), ball(3)))


def edges_and_vertices() -> tuple[State, ...]:
    return one(ball(4))


def rays_along_axes(state: State, count: int, seed: int) -> Rays:
    """Parallel to an axis, with zeros of both signs, from the very coordinates of vertices."""
    random = np.random.default_rng(seed)
    corners = world_corners(state).reshape(-1, 3)
    origins = corners[random.integers(0, len(corners), count)]
    axis, forward = random.integers(0, 3, count), random.random(count) < 0.5
    directions = np.where(random.random((count, 3)) < 0.5, 0.0, -0.0)
    rows = np.arange(count)
    directions[rows, axis] = np.where(forward, 1.0, -1.0)
    inside = random.random(count) < 0.5
    origins[rows, axis] = np.where(
        inside, random.uniform(-0.9, 0.9, count), origins[rows, axis] - 3.0 * directions[rows, axis]
    )
    return origins, directions


def rays_at_edges(state: State, count: int, seed: int) -> Rays:
    """From inside a closed surface, at points of its edges and at its vertices up to float32's precision."""
    random = np.random.default_rng(seed)
    corners = world_corners(state)
    chosen, corner = corners[random.integers(0, len(corners), count)], random.integers(0, 3, count)
    share = np.where(random.random((count, 1)) < 0.5, 0.0, random.random((count, 1)))
    rows = np.arange(count)
    targets = chosen[rows, corner] * (1.0 - share) + chosen[rows, (corner + 1) % 3] * share
    origins = random.uniform(-0.4, 0.4, (count, 3)).astype(np.float32)
    return origins.astype(np.float64), (targets.astype(np.float32) - origins).astype(np.float64)


def exact_edges() -> tuple[State, ...]:
    """A box whose corners, edges' eighths and rays are whole numbers of eighths."""
    return one(room(0.5))


def rays_exactly_at_edges(state: State, count: int, seed: int) -> Rays:
    """From around a box, through its vertices and eighths of its edges: float32 holds every number exactly."""
    random = np.random.default_rng(seed)
    corners = world_corners(state)
    chosen, corner = corners[random.integers(0, len(corners), count)], random.integers(0, 3, count)
    share = np.where(random.random((count, 1)) < 0.5, 0, random.integers(1, 8, (count, 1))) / 8
    rows = np.arange(count)
    targets = chosen[rows, corner] * (1.0 - share) + chosen[rows, (corner + 1) % 3] * share
    origins = random.integers(-40, 41, (count, 3)) / 8
    origins[rows, random.integers(0, 3, count)] = random.choice((-1, 1), count) * random.integers(5, 41, count) / 8
    return origins, targets - origins


def rays_in_planes(state: State, count: int, seed: int) -> Rays:
    """Half of them along an axis; half of them slanted, from points in a plane of the scene."""
    origins, directions = rays_along_axes(state, count, seed)
    half = count // 2
    targets = points_on(world_corners(state), half, seed + 1)
    origins[:half] *= 1.7
    directions[:half] = targets - origins[:half]
    directions[~directions.any(axis=1)] = (0.0, 0.0, 1.0)
    return origins, directions


FLAT_BOXES = FailureCase(
    "flat_boxes",
    "Flat boxes and triangles of no area",
    "The slab test: the plane of a flat box times an infinite inverse is 0 * inf, a NaN that fails every comparison.",
    "classic",
    "Components of zero are raised to a tiny share of the longest before they are inverted: no infinity, no NaN.",
    flat_boxes,
    rays_in_planes,
)
AXIS_PARALLEL_RAYS = FailureCase(
    "axis_parallel_rays",
    "Rays along the axes",
    "The slab test again: components of 0 and -0 in rays that begin on a box's plane. One peer missed all of them.",
    "measured",
    "The same, and intervals widened by what the test and the triangle's t can be off by (Ize 2013).",
    axis_parallel_rays,
    rays_along_axes,
    view=((1.6, -1.8, 1.2), (0.0, 0.0, 0.0)),
)
EDGES_AND_VERTICES = FailureCase(
    "edges_and_vertices",
    "Rays at edges and vertices",
    "Each triangle rounds its own edge: a ray slips between two that share one, out of a closed surface.",
    "embree 174, 188, 387",
    "Watertight edge functions (Woop, Benthin and Wald 2013), the same from both sides of an edge.",
    edges_and_vertices,
    rays_at_edges,
)
EXACT_EDGES = FailureCase(
    "exact_edges",
    "Rays exactly through edges, from outside",
    "Watertight is between neighbours alone: at an outline a rounded quotient moves a ray off the edge that it meets.",
    "measured: Embree, ROBUST or not, and BVHTree",
    "Where doubles cannot tell the side of an edge, sums of doubles do (Shewchuk 1997): exactly, edges included.",
    exact_edges,
    rays_exactly_at_edges,
)
CASES = (FLAT_BOXES, AXIS_PARALLEL_RAYS, EDGES_AND_VERTICES, EXACT_EDGES)
