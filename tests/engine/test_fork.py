"""A process that is forked while it has a scene: the child's copy is independent, and the parent's stays."""

from __future__ import annotations

import numpy as np
import perfect_bvh
from forks import needs_fork, run_in_child


@needs_fork
def test_a_forked_child_traces_and_commits(rng: np.random.Generator) -> None:
    corners = rng.normal(size=(3000, 1, 3)) + 0.2 * rng.normal(size=(3000, 3, 3))
    positions = corners.reshape(-1, 3).astype(np.float32)
    triangles = np.arange(len(positions)).reshape(-1, 3)
    rays = rng.normal(size=(20_000, 3)) * 4, rng.normal(size=(20_000, 3))

    def make(vertices: np.ndarray) -> perfect_bvh.Scene:
        scene = perfect_bvh.Scene()
        scene.add_instance(scene.add_mesh(vertices, triangles, usage="deforming"))
        scene.commit()
        return scene

    def trace(scene: perfect_bvh.Scene) -> np.ndarray:
        return np.asarray(scene.cast_rays(*rays, fields=("t_hit",)).t_hit)

    scene, moved = make(positions), positions * np.float32(1.25)
    before, after = trace(scene), trace(make(moved))

    def work() -> bool:
        is_same = np.array_equal(trace(scene), before)
        scene.update_mesh(0, moved)
        scene.commit()
        return is_same and np.array_equal(trace(scene), after)

    assert run_in_child(work) == 0
    np.testing.assert_array_equal(trace(scene), before)
    assert work()
