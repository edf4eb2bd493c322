"""Defines a failure case: a few small meshes, perhaps edited from state to state, and the rays that show the failure.

Plain numpy: the tests, the generated table and the files for Blender are all made from these.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from .shapes import Mesh

Float64Array = npt.NDArray[np.float64]
Rays = tuple[Float64Array, Float64Array]  # origins and directions, (R, 3) each


def _one_identity() -> Float64Array:
    return np.eye(4)[None]


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """One mesh and its instances; the same name in the next state is the same body.

    positions: (V, 3) float32, or float64 where float32 would not hold the case. triangles: (T, 3) int32.
    transforms: (I, 4, 4) object to world.
    """

    name: str
    positions: npt.NDArray[np.floating]
    triangles: npt.NDArray[np.int32]
    transforms: Float64Array = field(default_factory=_one_identity)

    def world_corners(self) -> Float64Array:
        """(I, T, 3, 3): the corners of every triangle of every instance."""
        corners = self.positions.astype(np.float64)[self.triangles]
        linear, shift = self.transforms[:, :3, :3], self.transforms[:, :3, 3]
        return np.einsum("iab,tcb->itca", linear, corners) + shift[:, None, None, :]


State = tuple[Body, ...]
"""Everything in the scene between two edits."""


@dataclass(frozen=True, slots=True)
class FailureCase:
    """A scene on which a usual method fails.

    name: identifier. title, breaks, held: for people: its title, the failure elsewhere, and how this engine avoids it.
    source: where it was seen. states: makes the states, one after the other, always the same. rays: makes `count` rays
    that show the failure for one of the states, from a seed. view: position and target of a camera that shows the
    failure; None: from outside, at all of it. grid: step to which a file rounds positions, so that it stays small;
    None: they are not rounded. is_loose: whether a file has the vertices alone, each three of which a modifier makes a
    triangle. halvings: how many more copies of the mesh's first part follow it, each half as large as the one before.
    """

    name: str
    title: str
    breaks: str
    source: str
    held: str
    states: Callable[[], tuple[State, ...]]
    rays: Callable[[State, int, int], Rays]
    view: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    grid: float | None = None
    halvings: int = 0
    is_loose: bool = False


def body(name: str, mesh: Mesh, transforms: npt.ArrayLike | None = None) -> Body:
    """A body of float32 positions, as Blender's are; transforms: (I, 4, 4), by default one that leaves it there."""
    placed = _one_identity() if transforms is None else np.asarray(transforms, np.float64)
    return Body(name, mesh[0].astype(np.float32), np.asarray(mesh[1], np.int32).reshape(-1, 3), placed)


def one(mesh: Mesh) -> tuple[State, ...]:
    """The states of a case that is one mesh and never changes."""
    return ((body("Mesh", mesh),),)


def finite(state: State) -> State:
    """The state without the triangles that have a corner which is no number, as the add-on passes it to the engine."""
    kept = []
    for part in state:
        sound = np.isfinite(part.positions).all(axis=1)
        triangles = part.triangles[sound[part.triangles].all(axis=1)]
        kept.append(Body(part.name, np.where(sound[:, None], part.positions, 0.0), triangles, part.transforms))
    return tuple(kept)


def world_corners(state: State) -> Float64Array:
    """(T, 3, 3): every triangle of the scene in world space, body by body, instance by instance."""
    parts = [part.world_corners().reshape(-1, 3, 3) for part in state]
    return np.concatenate(parts) if parts else np.empty((0, 3, 3))


def rays_around(state: State, count: int, seed: int) -> Rays:
    """From around and inside the scene's box, half towards points on its triangles and half towards any in the box."""
    random = np.random.default_rng(seed)
    corners = world_corners(finite(state))
    if len(corners) == 0:
        corners = np.array([[[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0], [0.0, 0.0, 0.0]]])
    lower, upper = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    reach = 0.7 * np.maximum(upper - lower, 1e-3 * np.max(upper - lower))
    middle = (lower + upper) / 2
    origins = middle + random.uniform(-1.6, 1.6, (count, 3)) * reach
    targets = points_on(corners, count, seed + 1)
    anywhere = random.random(count) < 0.5
    targets[anywhere] = middle + random.uniform(-1.0, 1.0, (int(anywhere.sum()), 3)) * reach
    return origins, (targets - origins) * 10.0 ** random.uniform(-1.0, 1.0, (count, 1))


def points_on(corners: Float64Array, count: int, seed: int) -> Float64Array:
    """Points (count, 3) of triangles (T, 3, 3), each triangle as likely as another."""
    random = np.random.default_rng(seed)
    chosen = corners[random.integers(0, len(corners), count)]
    return np.einsum("rc,rck->rk", random.dirichlet((1.0, 1.0, 1.0), count), chosen)
