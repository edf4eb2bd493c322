"""One mesh in many places: the rays' view of an instancing scene."""

from __future__ import annotations

import numpy as np
import perfect_bvh
from benchmarks.meshes import BenchMesh
from benchmarks.rays import Rays, camera_rays


class Instanced:
    """Instances on a square grid, turned and sized at random, seeded. transforms: (I, 4, 4)."""

    def __init__(self, mesh: BenchMesh, count: int) -> None:
        self._mesh = mesh
        lower, upper = mesh.positions.min(axis=0).astype(np.float64), mesh.positions.max(axis=0).astype(np.float64)
        self._size = float(np.linalg.norm(upper - lower))
        random = np.random.default_rng(21)
        turns = np.linalg.qr(random.normal(size=(count, 3, 3)))[0] * random.uniform(0.5, 1.0, (count, 1, 1))
        side = int(np.ceil(np.sqrt(count)))
        places = np.zeros((count, 3))
        places[:, 0], places[:, 2] = np.arange(count) % side, np.arange(count) // side
        self.transforms = np.tile(np.eye(4), (count, 1, 1))
        self.transforms[:, :3, :3] = turns
        self.transforms[:, :3, 3] = places * 0.8 * self._size - turns @ (0.5 * (lower + upper))
        self._lower = places.min(axis=0) * 0.8 * self._size - 0.5 * self._size
        self._upper = places.max(axis=0) * 0.8 * self._size + 0.5 * self._size

    def scene(self) -> perfect_bvh.Scene:
        """Committed; the instances' ids are the rows of `transforms`."""
        scene = perfect_bvh.Scene()
        mesh = scene.add_mesh(self._mesh.positions, self._mesh.triangles)
        scene.add_instances(np.full(len(self.transforms), mesh), self.transforms)
        scene.commit()
        return scene

    def rays(self, width: int, height: int) -> Rays:
        """Primary rays of a camera that sees all of them."""
        name = f"instanced {len(self.transforms)}"
        return camera_rays(name, self._lower, self._upper, False, width, height, np.random.default_rng(3))
