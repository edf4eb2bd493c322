"""A scene with many kinds of motion, and copies of it frozen at a time."""

from __future__ import annotations

import numpy as np
import perfect_bvh

from . import meshes
from .moving import positions_at, transform_at


def matrix(random: np.random.Generator, size: float = 1.0) -> np.ndarray:
    """(4, 4): any rotation, an uneven scale, some shear, a place."""
    made = np.eye(4)
    rotation, _ = np.linalg.qr(random.normal(size=(3, 3)))
    stretch = np.diag(random.uniform(0.5, 1.5, 3)) + np.triu(random.uniform(-0.2, 0.2, (3, 3)), 1)
    made[:3, :3] = size * rotation @ stretch
    made[:3, 3] = random.uniform(-1.0, 1.0, 3)
    return made


class MovingScene:
    """A soup and a ball that change shape, a cube that stays; instances that turn, and some that do not move."""

    def __init__(self, steps: int, time_range=(0.0, 1.0), seed: int = 0, dtype=np.float32, **settings) -> None:
        random = np.random.default_rng(seed)
        self.time_range, self.scene = time_range, perfect_bvh.Scene()
        soup, ball, cube = meshes.soup(120, seed), meshes.sphere(8, 12, 0.5), meshes.sphere(3, 4, 0.7)
        self.meshes, self.ids = [], []
        for (positions, triangles), moves in ((soup, True), (ball, True), (cube, False)):
            shapes = np.stack([positions + moves * random.normal(0, 0.15, positions.shape) for _ in range(steps)])
            mesh = self.scene.add_mesh(positions.astype(dtype), triangles, **settings)
            self.meshes.append((mesh, shapes.astype(dtype) if moves else None))
        self.instances = []
        for i, (mesh, _) in enumerate(self.meshes * 3):
            start = matrix(random, 0.8)
            identifier = self.scene.add_instance(mesh, start)
            turning = i % 3 == 2 or i >= 6
            path = np.stack([matrix(random, 0.8) for _ in range(steps)]) if turning else start[None]
            if turning:  # none of them turned inside out from the one before
                path[:, :3, 0] *= np.sign(np.linalg.det(path[:, :3, :3]))[:, None]
            self.instances.append((identifier, path))
        self.move()

    def move(self) -> None:
        for mesh, shapes in self.meshes:
            if shapes is not None:
                self.scene.set_mesh_motion(mesh, shapes, self.time_range)
        for identifier, path in self.instances:
            if len(path) > 1:
                self.scene.set_instance_motion([identifier], path[:, None], self.time_range)
        self.scene.commit()

    def frozen(self, scene: perfect_bvh.Scene, time: float) -> None:
        """Makes of a copy, whose ids are the same, the scene at that time."""
        for mesh, shapes in self.meshes:
            if shapes is not None:
                scene.update_mesh(mesh, positions_at(shapes, time, self.time_range))
        places = [transform_at(path, time, self.time_range) if len(path) > 1 else path[0] for _, path in self.instances]
        scene.set_transforms([identifier for identifier, _ in self.instances], places)
        scene.commit()


def still_copy(moving: MovingScene, steps: int, seed: int) -> perfect_bvh.Scene:
    return MovingScene(steps, moving.time_range, seed).scene
