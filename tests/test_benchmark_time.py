"""The benchmark of motion: its input to the native program, its treatment of the answer, its goals."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from benchmarks import generated_motion

# Replaces the native program: it answers with the size of its input, and with made-up speeds.
FAKE = """#!{python}
import json, sys
words = sys.argv[1:]
data = open(words[-1], "rb").read()
counts = [int.from_bytes(data[i : i + 4], "little") for i in (0, 4, 8)]
speeds = {{"embree": 2.0, "ours": 3.0, "embree still": 4.0, "ours still": 4.5, "ours still with times": 4.5}}
rays = [
    {{"rays": kind, "competitor": name, "ray_count": 10, "mrays_per_second": speed / (2 if kind == "diffuse" else 1),
      "different_from_first": 1}}
    for kind in words[words.index("--kinds") + 1].split(",") for name, speed in speeds.items()
]
out = {{"words": words, "counts": counts, "byte_count": len(data), "rays": rays}}
open(words[words.index("--json") + 1], "w").write(json.dumps(out))
"""


def run(repository: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(repository / "tests/benchmarks/time.py"), "--json", str(folder / "out.json")]
    command += [
        "--native",
        str(folder),
        "--noisy",
        "--rounds",
        "1",
        "--detail",
        "0.001",
        "--judged",
        "200000",
        *arguments,
    ]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


def test_tables_goals_and_verdicts(repository, tmp_path):
    program = tmp_path / "time_bench"
    program.write_text(FAKE.format(python=sys.executable))
    program.chmod(0o755)
    done = run(repository, tmp_path, "--kinds", "primary", "diffuse", "--steps", "2", "3")
    assert done.returncode == 0, done.stderr
    results = json.loads((tmp_path / "out.json").read_text())
    assert {"processor", "load_before"} <= set(results["machine"])
    scenes = [make(0.001, steps) for steps in (2, 3) for make in generated_motion.MAKERS.values()]
    assert [row["name"] for row in results["rows"]] == [scene.name for scene in scenes]
    for row, scene in zip(results["rows"], scenes, strict=True):
        assert row["counts"] == [len(scene.places), len(scene.meshes), len(scene.mesh)]
        floats = sum(shapes.size + triangles.size for shapes, triangles in scene.meshes) + scene.places.size
        assert row["byte_count"] == 4 * (3 + 3 * len(scene.meshes) + 2 * len(scene.mesh) + floats)
        assert ("--inside" in row["words"]) == scene.is_inside
        assert row["wrong"] == 0 and row["judged_hits"] > 0.02 * row["judged"]
    reached = {goal["goal"]: (goal["measured"], goal["reached"]) for goal in results["goals"]}
    assert reached["rays / Embree's motion blur, geometric mean"] == (pytest.approx(1.5), True)
    assert reached["moving, of the frozen scene's cost, most"] == (pytest.approx(1.5), False)
    assert reached["nothing moves, of the cost without times, most"] == (pytest.approx(1.0), True)
    assert "explosion, 3 steps, diffuse" in done.stdout


def test_a_program_that_is_not_built_is_named(repository, tmp_path):
    done = run(repository, tmp_path)
    assert done.returncode != 0
    assert "time_bench is not built; `nox -s benchmarks` builds it" in done.stderr


@pytest.mark.parametrize("name", list(generated_motion.MAKERS))
def test_scenes_move_and_are_alike_at_both_ends_of_any_steps(name):
    scene, finer = (generated_motion.MAKERS[name](0.001, steps) for steps in (2, 5))
    moved = [len(shapes) > 1 and np.ptp(shapes, axis=0).max() > 0.01 for shapes, _ in scene.meshes]
    assert scene.moves.any() or any(moved)
    assert np.isfinite(scene.places).all()
    for (shapes, triangles), (others, same) in zip(scene.meshes, finer.meshes, strict=True):
        assert np.array_equal(triangles, same) and triangles.max() < shapes.shape[1]
        assert np.array_equal(shapes[0], others[0]) and np.array_equal(shapes[-1], others[-1])
    assert np.array_equal(scene.places[0], finer.places[0])
    # A rotation and no scale, which all engines turn alike.
    turns = scene.places[..., :3].astype(np.float64)
    np.testing.assert_allclose(turns @ np.swapaxes(turns, -1, -2), np.broadcast_to(np.eye(3), turns.shape), atol=1e-6)
