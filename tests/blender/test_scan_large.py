"""Scans of a million triangles. The build is interrupted inside the engine by a stop, or by the end of the process."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.clouds import add_cloud  # noqa: E402
from blender.long_builds import Gate, building_threads  # noqa: E402
from oracles.brute_force import WorldTriangles, certain_hits  # noqa: E402
from perfect_bvh_addon import SpinningLidar, scan  # noqa: E402
from perfect_bvh_addon.scanning import Scanner  # noqa: E402


@pytest.mark.usefixtures("registered", "one_thread")
def test_a_build_of_a_million_triangles_is_stopped_and_repeated(scene, monkeypatch: pytest.MonkeyPatch) -> None:
    gate = Gate(monkeypatch, inside=True)
    made = add_cloud(1_000_000)
    head = bpy.data.objects.new("Head", None)
    scene.collection.objects.link(head)
    pattern = SpinningLidar(elevations=(-20.0, 10.0, 40.0), columns=4)
    scanner = Scanner(pattern, head)
    steps = scanner.steps()
    next(steps)
    gate.wait_until_held()
    next(steps)
    assert scanner.built_share is not None
    steps.close()
    gate.open()
    cloud = scan(pattern, head)
    corners = np.empty(9_000_000, np.float32)
    made.data.vertices.foreach_get("co", corners)
    world = WorldTriangles.of([(0, corners.reshape(-1, 3), np.arange(3_000_000), np.eye(4), 1)])
    local = pattern.cast(0.0, pattern.duration, None).directions
    directions = np.stack([local[:, 0], -local[:, 2], local[:, 1]], axis=1)  # forward is the object's +Y
    distances = dict(zip(cloud.ray_ids.tolist(), cloud.distances.tolist(), strict=True))
    assert cloud.ray_count == 12 and len(distances) > 8
    for ray, direction in enumerate(directions):
        sure, possible, t, bound = (found[0] for found in certain_hits(world, np.zeros((1, 3)), direction[None]))
        nearest = np.where(sure, t + bound, np.inf).min()
        if ray in distances:
            assert distances[ray] <= nearest
            assert (np.abs(t - distances[ray])[possible] <= bound[possible]).any()
        else:
            assert not np.isfinite(nearest)
    assert not building_threads()


def test_a_process_that_ends_during_a_build_ends_well(repository: Path) -> None:
    script = """
import bpy, perfect_bvh, perfect_bvh_addon, pytest
from blender.clouds import add_cloud
from blender.long_builds import Gate
from perfect_bvh_addon.scanning import Scanner, SpinningLidar
bpy.ops.wm.read_factory_settings(use_empty=True)
perfect_bvh_addon.register()
perfect_bvh.set_thread_count(1)
gate = Gate(pytest.MonkeyPatch(), inside=True)
add_cloud(1_000_000)
head = bpy.data.objects.new("Head", None)
bpy.context.scene.collection.objects.link(head)
scanner = Scanner(SpinningLidar(), head)
steps = scanner.steps()
next(steps)
gate.wait_until_held()
print("at work", scanner.built_share is not None, flush=True)
"""
    paths = os.pathsep.join([str(repository / "tests"), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "at work True\n" in done.stdout
