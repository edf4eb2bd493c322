"""Deformations after which a refitted tree is right and useless: its boxes lie over one another."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .case import FailureCase, State, body, rays_around
from .shapes import Mesh, ball, gravel


def _poses(mesh: Mesh, *later: np.ndarray) -> tuple[State, ...]:
    return tuple((body("Mesh", (positions, mesh[1])),) for positions in (mesh[0], *later))


def explosion() -> tuple[State, ...]:
    """Loose triangles that lie side by side fly apart, each on its own way."""
    mesh = gravel(900, 13, 0.02)
    random = np.random.default_rng(14)
    ways = np.repeat(random.normal(size=(900, 3)), 3, axis=0)
    return _poses(mesh, *(mesh[0] + step * ways for step in (0.5, 1.5, 3.0)))


def shuffle() -> tuple[State, ...]:
    """Loose triangles change places at random: neighbours in the tree are no longer neighbours."""
    mesh = gravel(1200, 15, 0.02)
    order = np.random.default_rng(16).permutation(1200)
    return _poses(mesh, mesh[0].reshape(1200, 3, 3)[order].reshape(-1, 3))


def twist() -> tuple[State, ...]:
    """A ball's upper end is turned, by 2 pi at last, while its lower end stands."""
    mesh = ball(4)
    return _poses(mesh, *(_twisted(mesh[0], angle) for angle in (np.pi / 2, np.pi, 1.5 * np.pi, 2 * np.pi)))


def _twisted(positions: np.ndarray, angle: float) -> np.ndarray:
    x, y, z = positions.T
    turn = angle * (z + 1.0) / 2.0
    return np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, z], axis=1)


def born_in_a_point() -> tuple[State, ...]:
    """All vertices in one place when the tree is built; then the ball they belong to unfolds."""
    mesh = ball(4)
    return _poses((np.zeros_like(mesh[0]), mesh[1]), mesh[0], 1.5 * mesh[0])


def long_refit_chain() -> tuple[State, ...]:
    """Loose triangles that drift, each a little on each of twelve frames and never back."""
    mesh = gravel(1200, 17, 0.02)
    random = np.random.default_rng(18)
    steps = np.cumsum(random.normal(0.0, 0.1, (12, 1200, 3)), axis=0)
    return _poses(mesh, *(mesh[0] + np.repeat(step, 3, axis=0) for step in steps))


def _refit_case(make: Callable[[], tuple[State, ...]], title: str, breaks: str, source: str) -> FailureCase:
    held = "The commit weighs the refitted tree against a fresh one and rebuilds; the report says which and why."
    return FailureCase(make.__name__, title, breaks, source, held, make, rays_around)


CASES = (
    _refit_case(
        explosion,
        "Explosion, then refit",
        "A refit keeps neighbours together that flew apart: every box grows to the whole.",
        "measured: trace speed falls to 0.6 and below",
    ),
    _refit_case(
        shuffle,
        "Shuffle, then refit",
        "A refit after triangles changed places: all boxes overlap, the cost is linear in the triangles.",
        "measured",
    ),
    _refit_case(
        twist,
        "Twist by 2 pi, then refit",
        "A refit along the way: boxes that were compact become rings around the axis.",
        "measured: 0.61 to 0.70",
    ),
    _refit_case(
        born_in_a_point,
        "Built in a point, then refit",
        "A tree over coincident vertices has no order to keep: refitted, it is degenerate for ever.",
        "public report: about 95 times slower",
    ),
    _refit_case(
        long_refit_chain,
        "A long chain of refits",
        "Each refit is a little worse than the last, and nothing ever says that it is enough.",
        "public report",
    ),
)
