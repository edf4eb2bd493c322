"""The benchmark of errors of images measures both engines and compares them at equal error and at equal CPU time."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest


def test_errors_of_images_are_measured_beside_cycles(repository: Path, tmp_path: Path) -> None:
    pytest.importorskip("bpy", reason="Blender's module is not installed")
    out = tmp_path / "image_error.json"
    command = [sys.executable, str(repository / "tests" / "benchmarks" / "image_error.py"), "--json", str(out)]
    cloth = str(repository / "blend_scenes" / "cloth.blend")
    command += ["--scenes", "gears", cloth, "--size", "64", "--most", "4", "--seeds", "1", "--converged", "64"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    figures = json.loads(out.read_text())
    assert [scene["name"] for scene in figures["scenes"]] == ["gears", "cloth"]
    for scene in figures["scenes"]:
        assert 0.0 < scene["converged_noise"] < 16.0
        runs = {run["name"]: run["points"] for run in scene["runs"]}
        assert list(runs) == ["ours", "ours, denoised", "Cycles", "Cycles, denoised"]
        for name, points in runs.items():
            assert [point["samples"] for point in points] == [1, 2, 4], name
            assert points[-1]["error"]["median"] < points[0]["error"]["median"], name
            assert all(point["cpu"]["median"] > 0.0 < point["wall"]["median"] for point in points), name
        for engine in ("ours", "Cycles"):
            assert runs[f"{engine}, denoised"][0]["error"]["median"] < runs[engine][0]["error"]["median"]
    assert list(figures["cpu_to_equal_error"]) == ["4"]
    assert set(figures["cpu_to_equal_error"]["4"]["scenes"]) == {"gears", "cloth"}
    beside = figures["error_at_equal_cpu"]["4"]["error"]
    assert set(beside["scenes"]) == {"gears", "cloth"} and beside["nearer"] in range(3)
    assert re.search(r"^cloth( +\d+\.\d+){3}", done.stdout, re.MULTILINE)
    assert "ours is nearer in " in done.stdout


def test_errors_are_compared_at_equal_cpu_time() -> None:
    pytest.importorskip("bpy", reason="Blender's module is not installed")
    from benchmarks.image_error import MOST_BEYOND, cpu_at, error_at

    points = [{"cpu": {"median": cpu}, "error": {"median": wrong}} for cpu, wrong in ((1.0, 8.0), (4.0, 4.0))]
    assert error_at(points, 0.5, "error") is None
    assert error_at(points, 2.0, "error") == pytest.approx(math.sqrt(32.0))
    assert error_at(points, 9.0, "error") == pytest.approx(4.0)
    assert cpu_at(points, 2.0) == pytest.approx(16.0)
    flat = [*points, {"cpu": {"median": 8.0}, "error": {"median": 4.0}}]
    assert cpu_at(flat, 3.9) == pytest.approx(8.0 * MOST_BEYOND), "a bias stays"


def test_the_noise_of_the_truth_is_no_error() -> None:
    pytest.importorskip("bpy", reason="Blender's module is not installed")
    from benchmarks.image_error import error, mean_of

    random = np.random.default_rng(1)
    halves, image = (random.normal(0.5, 0.02, (count, 90, 160, 3)).astype(np.float32) for count in (2, 1))
    truth, noise = mean_of(halves)
    assert noise == pytest.approx(255.0 * 0.02 / math.sqrt(2.0), rel=0.02)
    assert error(image[0], truth, noise) == pytest.approx(255.0 * 0.02, rel=0.02)
    assert mean_of(truth) == (pytest.approx(truth), 0.0)
