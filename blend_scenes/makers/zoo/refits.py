"""Deformations after which a refitted tree is right and useless: its boxes lie over one another."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .case import FailureCase, State, body, rays_around
from .shapes import Mesh, ball, gravel, joined, sheet, turned


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
    """A ball's upper end is turned, by 2 pi at last, while its lower end stays."""
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


def skinned_walk() -> tuple[State, ...]:
    """A crowd that is one skinned mesh: legs and arms swing, and each walks its own way for twelve frames."""
    random = np.random.default_rng(27)
    limbs = [ball(2)] + [ball(1)] * (len(_LIMBS) - 1)
    starts, headings, phases = (random.uniform(0.0, 2.0 * np.pi, (24, 2)) for _ in range(3))
    people = list(zip(starts - np.pi, headings[:, 0], phases[:, 0], strict=True))
    triangles = joined(*limbs * len(people))[1]
    frames = (np.concatenate([_walking(limbs, *person, frame) for person in people]) for frame in range(12))
    return tuple((body("Mesh", (positions, triangles)),) for positions in frames)


# Of a walker that looks along x: radii, where the middle is, how far it swings.
_LIMBS = (
    ((0.18, 0.25, 0.4), (0.0, 0.0, 1.2), 0.0),
    ((0.13, 0.13, 0.16), (0.0, 0.0, 1.8), 0.0),
    ((0.08, 0.08, 0.45), (0.0, 0.12, 0.45), 0.6),
    ((0.08, 0.08, 0.45), (0.0, -0.12, 0.45), -0.6),
    ((0.06, 0.06, 0.35), (0.0, 0.33, 1.2), -0.6),
    ((0.06, 0.06, 0.35), (0.0, -0.33, 1.2), 0.6),
)


def _walking(limbs: list[Mesh], start: np.ndarray, heading: float, phase: float, frame: int) -> np.ndarray:
    """(V, 3): one walker on one frame; limbs turn about their upper ends."""
    parts = []
    for (positions, _), (radii, middle, swing) in zip(limbs, _LIMBS, strict=True):
        top = np.array((0.0, 0.0, radii[2]))
        angle = swing * np.sin(phase + 1.1 * frame)
        parts.append((positions * radii - top) @ turned(1, angle)[:3, :3].T + top + middle)
    way = 0.35 * frame * np.array((np.cos(heading), np.sin(heading), 0.0))
    return np.concatenate(parts) @ turned(2, heading)[:3, :3].T + (*start, 0.0) + way


def crumpled_cloth() -> tuple[State, ...]:
    """A cloth that is folded once more, about another line, on each of eleven frames."""
    positions, triangles = sheet(40)
    random = np.random.default_rng(3)
    frames = [positions]
    for _ in range(11):
        frames.append(_folded(frames[-1], *random.normal(size=(2, 3))))
    return tuple((body("Mesh", (positions, triangles)),) for positions in frames)


def _folded(positions: np.ndarray, across: np.ndarray, any_way: np.ndarray) -> np.ndarray:
    """The part beyond a plane through the middle is turned about a line in it, by up to 63 degrees."""
    across = across / np.linalg.norm(across)
    axis = np.cross(across, any_way)
    axis /= np.linalg.norm(axis)
    middle = positions.mean(axis=0)
    from_middle = positions - middle
    angle = 1.1 * np.clip(3.0 * from_middle @ across, 0.0, 1.0)[:, None]
    along = axis * (from_middle @ axis)[:, None]
    return (
        middle + from_middle * np.cos(angle) + np.cross(axis, from_middle) * np.sin(angle) + along * (1 - np.cos(angle))
    )


def _refit_case(
    make: Callable[[], tuple[State, ...]], title: str, breaks: str, source: str, grid: float | None = None
) -> FailureCase:
    held = "The commit weighs the refitted tree against a fresh one and rebuilds; the report says which and why."
    return FailureCase(make.__name__, title, breaks, source, held, make, rays_around, grid=grid)


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
        grid=2.0**-9,
    ),
    _refit_case(
        skinned_walk,
        "A crowd of walkers in one mesh",
        "Limbs stay compact, but who stood together walks apart: each frame's refit is a little worse than the last.",
        "public report",
        grid=2.0**-6,
    ),
    _refit_case(
        crumpled_cloth,
        "Cloth that crumples",
        "Folds that were far apart on the flat cloth come to lie on one another, and their boxes with them.",
        "public report",
    ),
)
