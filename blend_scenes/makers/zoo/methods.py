"""Ordinary meshes on which it is the method that fails: packets, an optimiser, another instruction set."""

from __future__ import annotations

import numpy as np

from .case import FailureCase, Rays, State, one, rays_around, world_corners
from .shapes import ball, gravel, joined


def incoherent_packets() -> tuple[State, ...]:
    return one(joined(ball(3, 0.6), gravel(600, 21, 0.1)))


def other_instruction_set() -> tuple[State, ...]:
    return one(ball(4))


def own_ancestor() -> tuple[State, ...]:
    """Swarms of very different sizes: much to gain by moving nodes about."""
    swarms = [gravel(200, 22 + k, 0.01 * 3.0**k, 3.0**k) for k in range(5)]
    return one(joined(*swarms))


def rays_close_to_edges(state: State, count: int, seed: int) -> Rays:
    """Past edges at a distance of a few roundings, from outside."""
    random = np.random.default_rng(seed)
    corners = world_corners(state)
    chosen, corner = corners[random.integers(0, len(corners), count)], random.integers(0, 3, count)
    rows, share = np.arange(count), random.random((count, 1))
    targets = chosen[rows, corner] * (1.0 - share) + chosen[rows, (corner + 1) % 3] * share
    targets += random.normal(0.0, 1e-7, targets.shape)
    origins = targets * 2.0 + random.uniform(-0.5, 0.5, (count, 3))
    return origins, targets - origins


INCOHERENT_PACKETS = FailureCase(
    "incoherent_packets",
    "Packets of rays that go different ways",
    "A packet is culled by the frustum of its corner rays, although the others are not inside it: false misses.",
    "pytinybvh",
    "Bounds hold all of a packet's rays, leaves ask each ray for itself, and rays that part go on alone.",
    incoherent_packets,
    rays_around,
)
OTHER_INSTRUCTION_SET = FailureCase(
    "other_instruction_set",
    "Another instruction set, another answer",
    "Fused and separate multiplications round differently: hit on one machine, miss on another.",
    "embree 423",
    "One order of operations with explicit fma everywhere: every instruction set gives the same bits.",
    other_instruction_set,
    rays_close_to_edges,
)
OWN_ANCESTOR = FailureCase(
    "own_ancestor",
    "An optimiser makes a node its own ancestor",
    "Reinsertion below a node that is itself being moved closes a ring: traversal never ends.",
    "madmann91/bvh 84",
    "The search goes up from the node and into the subtrees on the other side only, so never below itself.",
    own_ancestor,
    rays_around,
)
CASES = (INCOHERENT_PACKETS, OTHER_INSTRUCTION_SET, OWN_ANCESTOR)
