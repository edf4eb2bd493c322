"""Work that takes a second or more of any core, for tests that stop the engine in the middle of it.

It asks its `progress` for the first time after a twentieth of a second; one thread, so that no machine is faster for
having many.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import perfect_bvh
from oracles import meshes


def stack(height: int = 100) -> perfect_bvh.Scene:
    """The same triangle many times: a ray that hits one has to test all."""
    corners = np.tile(np.array([(-1, -1, 0), (1, -1, 0), (0, 1, 0)], np.float32), (height, 1))
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(corners, np.arange(len(corners)).reshape(-1, 3)))
    scene.commit()
    return scene


def rays_through_it(count: int = 1_000_000) -> dict[str, Any]:
    """Arguments of a query."""
    origins = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (count, 3))
    return {"origins": origins, "directions": np.array([0.0, 0.0, -1.0]), "threads": 1}


def large_mesh() -> tuple[npt.NDArray[np.floating[Any]], npt.NDArray[np.integer[Any]]]:
    """A mesh to build with the fixture `one_thread`."""
    return meshes.sphere(1000, 1400)
