"""One mesh in many places: through one another, or by matrices that are not rigid."""

from __future__ import annotations

import numpy as np

from .case import FailureCase, State, body, rays_around
from .shapes import ball, moved, sheet, turned


def interleaved_instances() -> tuple[State, ...]:
    """Sixty-four balls so close that every one reaches deep into its neighbours."""
    random = np.random.default_rng(12)
    cells = np.stack(np.meshgrid(*[np.arange(4.0)] * 3), axis=-1).reshape(-1, 3)
    places = [moved(cell * 0.8) @ turned(2, turn) for cell, turn in zip(cells, random.uniform(0, 6, 64), strict=True)]
    return ((body("Ball", ball(2), places),),)


def skewed_matrices() -> tuple[State, ...]:
    """A ball and a sheet stretched, mirrored, sheared, flattened to nothing along an axis, and shrunk to 1e-4."""
    shear = np.eye(4)
    shear[0, 1], shear[2, 0] = 1.5, 0.4
    maps = [
        np.diag([3.0, 0.3, 1.0, 1.0]),
        np.diag([-1.0, 1.0, 1.0, 1.0]),
        shear,
        np.diag([1.0, 1.0, 0.0, 1.0]) @ turned(1, 0.7),
        np.diag([1e-4, 1e-4, 1e-4, 1.0]),
    ]
    places = [moved((3.0 * k, 0.0, 0.0)) @ map_ for k, map_ in enumerate(maps)]
    above = [moved((0.0, 0.0, 2.5)) @ place for place in places]
    return ((body("Ball", ball(2), places), body("Sheet", sheet(4), above)),)


INTERLEAVED_INSTANCES = FailureCase(
    "interleaved_instances",
    "Interleaved instances",
    "A flat list of instances asks every one; a tree over them cannot part boxes that overlap.",
    "Benthin 2017: 1.2 to 2.1 times by rebraiding",
    "An agglomerative top level (Walter 2008) over tight world boxes; the nearest instance first.",
    interleaved_instances,
    rays_around,
)
SKEWED_MATRICES = FailureCase(
    "skewed_matrices",
    "Stretched, mirrored, sheared, flattened instances",
    "Normals carried by the matrix itself, t of a renormalised direction, no inverse where a scale is 0.",
    "three-mesh-bvh 671",
    "Rays by the inverse with their length kept, normals from world corners; flattened instances are baked.",
    skewed_matrices,
    rays_around,
)
CASES = (INTERLEAVED_INSTANCES, SKEWED_MATRICES)
