"""Both benchmarks run on a small mesh without the native programs and write what they promise; no time is looked at."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles import meshes

TREES = ["median", "sweep", "binned", "binned+optimize", "spatial", "fast"]


@pytest.fixture
def mesh_file(tmp_path: Path) -> Path:
    positions, triangles = meshes.sphere(12, 16)
    path = tmp_path / "ball.npz"
    np.savez(path, positions=positions.astype(np.float32), triangles=triangles)
    return path


def run(repository: Path, script: str, mesh_file: Path, *arguments: str) -> tuple[dict[str, Any], str]:
    """The JSON that a benchmark wrote, and what it said."""
    out = mesh_file.parent / "figures" / "out.json"
    command = [sys.executable, str(repository / "tests" / "benchmarks" / script), "--mesh", str(mesh_file)]
    command += ["--json", str(out), "--native", str(mesh_file.parent / "nowhere"), "--rounds", "1"]
    command += ["--size", "24x16", "--ray-limit", "40", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    results = json.loads(out.read_text())
    assert results["machine"]["isa"] in results["machine"]["available_isas"]
    assert {"commit", "processor", "threads", "versions", "time"} <= set(results["machine"])
    assert any("nox -s benchmarks" in line for line in results["left_out"])
    assert "left out: Embree" in done.stdout
    return results, done.stdout


def check_spread(spread: dict[str, float]) -> None:
    assert 0.0 < spread["low"] <= spread["median"] <= spread["high"] < np.inf


def test_the_benchmark_of_builders(repository, mesh_file):
    results, table = run(repository, "build.py", mesh_file, "--trees", *TREES)
    (mesh,) = results["meshes"]
    assert (mesh["name"], mesh["triangle_count"], mesh["measured"]) == ("ball", 352, "python")
    assert [tree["name"] for tree in mesh["trees"]] == TREES
    for tree in mesh["trees"]:
        assert "1" in tree["ready_ms"]
        for spread in tree["ready_ms"].values():
            check_spread(spread)
        assert tree["sah"] > 1.0
        assert tree["epo"] >= 0.0
        assert tree["ready_byte_count"] > 352 * 12
        assert set(tree["rays"]) == {"primary", "diffuse", "occlusion"}
        for rays in tree["rays"].values():
            check_spread(rays["rounds"])
            assert rays["nodes_visited"] > 0.0
            assert rays["ray_count"] > 0
        assert tree["name"] in table
    assert "perfect_bvh" in [peer["name"] for peer in mesh["from_python"]]
    assert "the lecture" in table


def test_the_benchmark_of_rays(repository, mesh_file):
    results, table = run(repository, "trace.py", mesh_file, "--sample", "60", "--instances", "8")
    (mesh,) = results["meshes"]
    kinds = {rays["name"]: rays for rays in mesh["from_python"]}
    assert set(kinds) == {"primary", "diffuse", "shuffled", "occlusion", "instanced 8"}
    for name, rays in kinds.items():
        rows = {row["name"]: row for row in rays["peers"]}
        assert {f"perfect_bvh, {isa}" for isa in results["machine"]["available_isas"]} <= set(rows), name
        for row in rows.values():
            check_spread(row["rounds"])
            assert row["mrays_per_second"] > 0.0
            assert 0 < row["wrong"]["judged"] <= 60
        assert all(row["wrong"]["wrong"] == 0 for key, row in rows.items() if key.startswith("perfect_bvh")), name
        assert name in table


def test_a_missing_mesh_is_named(repository, mesh_file):
    script = repository / "tests" / "benchmarks" / "build.py"
    missing = mesh_file.with_name("none.npz")
    command = [sys.executable, str(script), "--mesh", str(missing), "--json", str(mesh_file.with_name("o.json"))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode != 0
    assert "none.npz: there is no such file" in done.stderr
