"""The benchmark of curves and points: its input to the native program, its treatment of the answer, its goals."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks import curves, generated_curves

# Replaces the native program: it answers with its input, and with made-up speeds.
FAKE = """#!{python}
import json, sys
words = sys.argv[1:]
counts = [int.from_bytes(open(words[-1], "rb").read(12)[i : i + 4], "little") for i in (0, 4, 8)]
primitives = counts[0] - counts[1]
others = ["embree flat", "embree cubic", "ours ribbon"]
names = ["embree round", "tubes", "ours"] + (others if counts[1] else [])
speeds = {{"embree round": 2.0, "tubes": 1.0, "ours": 3.0, "embree flat": 2.5, "embree cubic": 1.5, "ours ribbon": 3.5}}
rays = [
    {{"rays": kind, "competitor": name, "ray_count": 10, "mrays_per_second": speeds[name],
      "different_from_first": 1, "byte_count": 50 * primitives}}
    for kind in words[words.index("--kinds") + 1].split(",") for name in names
]
def each(key, values):
    return [{{"competitor": n, key: {{"median": v, "low": v, "high": v}}}} for n, v in values.items()]
out = {{"primitive_count": primitives, "words": words, "counts": counts, "rays": rays,
       "builds": each("ready_ms", {{"embree round": 10.0, "tubes": 30.0, "ours": 5.0}}),
       "refits": each("ns_a_primitive", {{"embree round": 10.0, "ours": 8.0}})}}
open(words[words.index("--json") + 1], "w").write(json.dumps(out))
"""


def run(repository: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(repository / "tests/benchmarks/curves.py"), "--json", str(folder / "out.json")]
    command += ["--native", str(folder), "--noisy", "--rounds", "1", "--detail", "0.001", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


def test_tables_and_goals(repository, tmp_path):
    program = tmp_path / curves.PROGRAM
    program.write_text(FAKE.format(python=sys.executable))
    program.chmod(0o755)
    done = run(repository, tmp_path, "--kinds", "primary", "shuffled")
    assert done.returncode == 0, done.stderr
    results = json.loads((tmp_path / "out.json").read_text())
    assert {"processor", "load_before"} <= set(results["machine"])
    names = [row["name"] for row in results["rows"]]
    assert names == ["lawn", "fur", "long hair", "scan"]
    for row, balls in zip(results["rows"], generated_curves.make_all(0.001), strict=True):
        assert row["counts"][0] == len(balls.points) and row["counts"][2] == generated_curves.WIND_FRAMES
        assert row["primitive_count"] == balls.primitive_count
        assert ("--inside" in row["words"]) == balls.is_inside
    reached = {goal["goal"]: (goal["measured"], goal["reached"], goal["where"]) for goal in results["goals"]}
    assert reached["rays / Embree's round curves and spheres, geometric mean"] == (pytest.approx(1.5), True, "of 8")
    assert reached["rays / tubes of six sides, geometric mean"][:2] == (pytest.approx(3.0), True)
    assert reached["bytes a segment or point, most"][:2] == (50.0, False)
    assert reached["ready / Embree MEDIUM, least"][:2] == (2.0, True)
    assert reached["refit, of Embree's time, most"][:2] == (0.8, False)
    assert "long hair, shuffled" in done.stdout and "refit, of Embree's time, most" in done.stdout


def test_without_the_native_program(repository, tmp_path):
    done = run(repository, tmp_path)
    assert done.returncode == 1 and "`nox -s benchmarks` builds it" in done.stderr


def test_the_least_and_where():
    def row(name: str, ours: float) -> dict[str, Any]:
        speeds = {"embree round": 2.0, "tubes": 1.0, "ours": ours}
        rays = [
            {"rays": kind, "competitor": who, "mrays_per_second": speed, "byte_count": 30}
            for kind in curves.KINDS
            for who, speed in speeds.items()
        ]
        spreads = {who: {"median": 1.0} for who in ("embree round", "ours")}
        return {
            "name": name,
            "primitive_count": 1,
            "rays": rays,
            "builds": [{"competitor": who, "ready_ms": spread} for who, spread in spreads.items()],
            "refits": [{"competitor": who, "ns_a_primitive": spread} for who, spread in spreads.items()],
        }

    goals = {goal["goal"]: goal for goal in curves.judge([row("fur", 4.0), row("lawn", 1.0)])}
    least = goals["rays / Embree's round curves and spheres, least"]
    assert (least["measured"], least["reached"], least["where"]) == (0.5, False, "lawn, primary")
    mean = goals["rays / Embree's round curves and spheres, geometric mean"]
    assert mean["measured"] == pytest.approx(1.0) and not mean["reached"]


def test_what_is_written_for_the_native_program(tmp_path):
    """Counts, then balls, first balls of curves, and the centres of frames in which all but the roots move."""
    balls = generated_curves.fur(0.001)
    path = tmp_path / "fur.bin"
    balls.write(path)
    numbers = np.fromfile(path, np.uint32)
    count, curve_count, frame_count = (int(number) for number in numbers[:3])
    floats = numbers.view(np.float32)[3:]
    rows = floats[: 4 * count].reshape(-1, 4)
    assert (rows[:, :3] == balls.points).all() and (rows[:, 3] == balls.radii).all()
    assert balls.offsets is not None
    assert (numbers[3 + 4 * count : 3 + 4 * count + curve_count] == balls.offsets[:-1]).all()
    frames = floats[4 * count + curve_count :].reshape(frame_count, count, 3)
    roots = balls.offsets[:-1]
    assert all((frame[roots] == balls.points[roots]).all() and (frame != balls.points).any() for frame in frames)
    assert (frames[0] != frames[1]).any()
