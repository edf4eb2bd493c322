"""A process that is forked while it has a scene: the child's copy is a scene of its own, and the parent's stays."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable

import numpy as np
import perfect_bvh
import pytest

SECONDS = 120.0


def run_in_child(work: Callable[[], bool]) -> int | None:
    """0 if the work came true in a forked process, 1 if not, 2 if it raised, None if it did not end."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # newer Pythons warn of threads, which are the point
        child = os.fork()
    if child == 0:
        code = 2
        try:
            code = 0 if work() else 1
        finally:
            os._exit(code)
    until = time.monotonic() + SECONDS
    while time.monotonic() < until:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.02)
    os.kill(child, 9)
    os.waitpid(child, 0)
    return None


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
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
