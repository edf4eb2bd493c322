"""Coordinates far from one and from zero, and some that are no numbers."""

from __future__ import annotations

import numpy as np

from .case import Body, FailureCase, Rays, State, body, finite, one, rays_around
from .shapes import ball, gravel, joined, sheet, turned

HALF_GROUND = 50_000.0
SCALES = (1.0, 1e-6, 1e8, 1e11)
OFFSET = 1e6


def extreme_magnitudes() -> tuple[State, ...]:
    """A ball among loose triangles, of normal size, tiny, huge, vast; then a million units from zero."""
    positions, triangles = joined(ball(3, 0.7), gravel(150, 8, 0.2))
    sizes = [(body("Mesh", (positions * scale, triangles)),) for scale in SCALES]
    return (*sizes, (body("Mesh", (positions + OFFSET, triangles)),))


def large_ground() -> tuple[State, ...]:
    """Nine balls of a few centimetres, sunk half-way into two triangles that are 100 kilometres wide and aslant."""
    balls = [ball(3, 0.02 + 0.005 * row, (0.12 * (row % 3 - 1), 0.12 * (row // 3 - 1), 0.0)) for row in range(9)]
    positions, triangles = joined(sheet(1, HALF_GROUND), *balls)
    slope = turned(0, 0.3) @ turned(1, 0.2)
    return one((positions @ slope[:3, :3].T, triangles))


def rays_at_the_middle(state: State, count: int, seed: int) -> Rays:
    """From some decimetres above the balls to them and the ground between."""
    random = np.random.default_rng(seed)
    up, across = turned(0, 0.3) @ turned(1, 0.2), random.uniform(-0.3, 0.3, (2, count, 2))
    origins = np.column_stack([across[0], random.uniform(0.1, 0.6, count)])
    targets = np.column_stack([across[1], np.zeros(count)])
    return origins @ up[:3, :3].T, (targets - origins) @ up[:3, :3].T


def small_triangles() -> tuple[State, ...]:
    """A ball of half a thousandth: the determinants of its triangles are below every usual epsilon."""
    return one(ball(4, 5e-4))


def non_finite_vertices() -> tuple[State, ...]:
    """A ball of which four vertices are not numbers, each in its own way."""
    positions, triangles = ball(3)
    positions = positions.copy()
    random = np.random.default_rng(9)
    for vertex, value in zip(
        random.choice(len(positions), 4, replace=False), (np.nan, np.inf, -np.inf, np.nan), strict=True
    ):
        positions[vertex, random.integers(0, 3)] = value
    return ((Body("Mesh", positions.astype(np.float32), triangles),),)


def rays_around_the_rest(state: State, count: int, seed: int) -> Rays:
    return rays_around(finite(state), count, seed)


EXTREME_MAGNITUDES = FailureCase(
    "extreme_magnitudes",
    "Tiny, huge and far away",
    "Absolute tolerances, and cancellation in o - v0 where both are large: ghost hits and lost hits.",
    "embree 416, measured",
    "Bounds relative to the coordinates at hand; far rays are moved up first; float64 meshes are recentred.",
    extreme_magnitudes,
    rays_around,
)
SMALL_TRIANGLES = FailureCase(
    "small_triangles",
    "Small triangles",
    "An absolute epsilon in the determinant: small triangles are taken for edge-on ones and vanish.",
    "measured: 12 to 37 % of rays",
    "No epsilon: only a determinant of zero is edge-on.",
    small_triangles,
    rays_around,
)
LARGE_GROUND = FailureCase(
    "large_ground",
    "Pebbles on a ground of 100 kilometres",
    "t from corners that are kilometres away is off by roundings of those: what lies on the ground floats or sinks.",
    "measured",
    "t is that of the plane, in double precision, which decides beside edges, too.",
    large_ground,
    rays_at_the_middle,
    view=((0.1, -0.55, 0.1), (0.0, 0.0, 0.0)),
)
NON_FINITE_VERTICES = FailureCase(
    "non_finite_vertices",
    "Vertices that are no numbers",
    "One NaN reaches the root's box by way of min and max, and every ray misses.",
    "ifc-lite 3561",
    "The engine refuses such a mesh by name; the add-on leaves out those triangles, keeps the others' ids and says so.",
    non_finite_vertices,
    rays_around_the_rest,
)
CASES = (EXTREME_MAGNITUDES, LARGE_GROUND, SMALL_TRIANGLES, NON_FINITE_VERTICES)
