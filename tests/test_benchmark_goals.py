"""Benchmarks refuse a machine that is not quiet; the tables of goals give and judge the figures correctly.

No test depends on a time.
"""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks import budget, generated_meshes, goal_figures, goals, machine, options
from benchmarks.goal_list import Goal, goals_of
from benchmarks.goal_tables import describe, repeated
from benchmarks.native import NativeError, NativePrograms
from benchmarks.python_rays import PAIRS, measure_from_python


def with_load(monkeypatch: pytest.MonkeyPatch, load: float) -> None:
    monkeypatch.setattr(os, "getloadavg", lambda: (load, 0.0, 0.0))


def test_a_loaded_machine_is_refused_unless_noise_is_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    with_load(monkeypatch, 1.21)
    with pytest.raises(SystemExit, match=r"the load is 1\.21, above 1\.2: .* --noisy"):
        machine.require_quiet(is_noisy=False)
    assert machine.require_quiet(is_noisy=True) == 1.21
    with_load(monkeypatch, 1.2)
    assert machine.require_quiet(is_noisy=False) == 1.2


@pytest.mark.parametrize("script", ["build", "trace", "refit", "accuracy", "goals"])
def test_every_native_race_asks_for_the_load(script: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with_load(monkeypatch, 3.0)
    out = tmp_path / "out.json"
    monkeypatch.setattr(sys, "argv", [f"{script}.py", "--json", str(out)])
    module = __import__(f"benchmarks.{script}", fromlist=["main"])
    with pytest.raises(SystemExit, match=r"the load is 3\.00"):
        module.main()
    assert not out.exists()


def test_the_limit_is_the_native_programs(repository: Path) -> None:
    source = (repository / "native" / "benchmarks" / "quiet.h").read_text(encoding="utf-8")
    (limit,) = re.findall(r"kMostLoad = ([\d.]+);", source)
    assert float(limit) == machine.MOST_LOAD


def test_the_headline_names_processor_caches_and_load(monkeypatch: pytest.MonkeyPatch) -> None:
    with_load(monkeypatch, 0.75)
    described = machine.describe(0.25)
    line = machine.headline(described)
    assert line.startswith(described["processor"])
    assert "load 0.25 before, 0.75 after" in line
    for level, size in described["caches"].items():
        assert re.fullmatch(r"L\d[d]?", level) and re.fullmatch(r"\d+[KM]", size)
        assert f"{level} {size}" in line


def test_native_programs_run_whatever_the_load_once_that_was_asked(tmp_path: Path) -> None:
    (ball,) = generated_meshes.make_all(0.0001)[:1]
    program = tmp_path / "told_bench"
    program.write_text(f"#!{sys.executable}\nimport sys\nprint(sys.argv)\nsys.exit(3)\n")
    program.chmod(0o755)
    with pytest.raises(NativeError, match="'--noisy'"):
        NativePrograms(tmp_path).run("told_bench", ball, [])
    with pytest.raises(NativeError) as raised:
        NativePrograms(tmp_path).run("told_bench", ball, [], is_timed=False)
    assert "--noisy" not in str(raised.value)


def test_generated_meshes_are_what_they_are_called() -> None:
    meshes = {mesh.name: mesh for mesh in generated_meshes.make_all(0.01)}
    again = {mesh.name: mesh for mesh in generated_meshes.make_all(0.01)}
    assert list(meshes) == ["city", "foliage", "hair quads"]
    assert [mesh.is_inside for mesh in meshes.values()] == [True, True, False]
    for name, mesh in meshes.items():
        assert np.array_equal(mesh.positions, again[name].positions), name
        assert mesh.triangles.min() == 0 and mesh.triangles.max() == len(mesh.positions) - 1
        assert (np.linalg.norm(_crosses(mesh), axis=1) > 0.0).all(), name
    city, quads = meshes["city"], meshes["hair quads"]
    normals = _crosses(city) / np.linalg.norm(_crosses(city), axis=1, keepdims=True)
    assert np.allclose(np.sort(np.abs(normals), axis=1), [0.0, 0.0, 1.0], atol=1e-5), "boxes lie along the axes"
    ground = city.positions[city.triangles[-2:].ravel()]
    assert (ground[:, 1] == 0.0).all() and np.ptp(ground[:, 0]) >= np.ptp(city.positions[:, 0])
    corners = city.positions[city.triangles[:-2]]
    outward = corners.mean(axis=1) - np.repeat(corners.reshape(-1, 36, 3).mean(axis=1), 12, axis=0)
    assert (np.einsum("ij,ij->i", outward, normals[:-2]) > 0.0).all(), "boxes face outwards"
    sides = np.linalg.norm(np.diff(quads.positions.reshape(-1, 4, 3), axis=1), axis=2)
    assert np.allclose(sides[:, 0], 100.0 * sides[:, 1], rtol=1e-2)
    slant = np.abs(_crosses(quads)) / np.linalg.norm(_crosses(quads), axis=1, keepdims=True)
    assert np.median(slant.max(axis=1)) < 0.95


def _crosses(mesh: Any) -> np.ndarray:
    a, b, c = np.moveaxis(mesh.positions[mesh.triangles].astype(np.float64), 1, 0)
    return np.cross(b - a, c - a)


def ray_rows(mesh: str, triangle_count: int, speeds: dict[str, float]) -> list[dict[str, Any]]:
    """Rows as trace_bench prints them; speeds: by competitor, the same for all kinds."""
    kinds = [*goal_figures.KINDS, *goal_figures.COHERENT]
    common = {"mesh": mesh, "triangle_count": triangle_count, "isa": "best", "ray_count": 500}
    return [
        {
            **common,
            "rays": kind,
            "batch": batch,
            "competitor": name,
            "mrays_per_second": speed,
            "different_from_first": 0,
        }
        for kind, batch in kinds
        for name, speed in speeds.items()
    ]


def results_of_figures() -> dict[str, list[dict[str, Any]]]:
    engines = {"embree": 2.0, "embree_robust": 1.0, "embree_avx2": 4.0, "embree_packets": 8.0, "best/auto": 4.0}
    small = ray_rows("small", 1000, {**engines, "avx2/auto": 2.0})
    city = ray_rows("city", 1000, {**engines, "best/auto": 1.0, "avx2/auto": 8.0})
    large = ray_rows("large", 3_000_000, {**engines, "best/auto": 5.0, "avx2/auto": 8.0})
    builds = [
        {"mesh": "small", "name": name, "triangle_count": 1000, "gigahertz": 2.0, "ready_ms": {"median": median}}
        | {"ready_byte_count": 50_000}
        for name, median in {"auto": 0.5, "fast": 0.4, "changing": 0.1, "spatial": 2.0}.items()
    ]
    for name, median in {"embree_low": 0.2, "embree_medium": 1.0, "embree_high": 4.0}.items():
        builds.append({**builds[0], "name": name, "ready_ms": {"median": median}, "ready_byte_count": 80_000})
    instances = [
        {"mesh": "small", "layout": "grid", "instances": 1000, "kind": kind, "competitor": name}
        | {"set_ms": 1.0, "commit_ms": commit}
        for kind in ("first", "commit")
        for name, commit in {"embree": 7.0, "array": 1.0, "ours": 3.0}.items()
    ]
    refits = [
        {"mesh": "small", "method": method, "ns_per_triangle": nanoseconds}
        for method, nanoseconds in (("refit", 8.0), ("embree refit", 32.0))
    ]
    one_thread = {"t, triangle": 3.0, "embreex, triangle": 1.5, "default fields": 2.0, "embreex, all fields": 2.0}
    python = [{"mesh": "small", "rays": "diffuse", "one_thread": one_thread, "wall": {"1": 1.0, "2": 1.9}}]
    return {"rays": small + city + large, "builds": builds, "instances": instances, "refits": refits, "python": python}


def test_goals_are_judged_by_what_was_measured() -> None:
    goals_by_name = {goal.name: goal for goal in goals_of(results_of_figures())}

    def judged(name: str) -> tuple[float, bool]:
        return pytest.approx(goals_by_name[name].value), goals_by_name[name].is_reached

    assert judged("rays / Embree's default, geometric mean") == (1.0, False)  # 2 and a half: one outlier
    assert judged("rays / Embree's default, least") == (0.5, False)
    assert goals_by_name["rays / Embree's default, least"].where == "city, primary, 1,000,000"
    assert judged("rays / Embree ROBUST, geometric mean") == (2.0, True)
    assert judged("rays / Embree's default, AVX2 alone, least") == (0.5, False)
    assert judged("rays / Embree's default, 2 million triangles or more, geometric mean") == (2.5, True)
    assert judged("coherent rays / Embree's 16-wide packets, least") == (0.125, False)
    assert judged("short rays, occlusion / Embree's default, least") == (0.5, False)
    assert judged("auto ready / Embree MEDIUM, least") == (2.0, True)
    assert judged("fast ready / Embree LOW, least") == (0.5, False)
    assert judged("changing ready / Embree LOW, least") == (2.0, True)
    assert judged("million triangles a second, core and GHz, ready, least") == (1.0, True)
    assert judged("bytes a triangle, most") == (50.0, True)
    assert judged("instances, first build / the soonest of Embree's, least") == (0.5, False)
    assert judged("refit, of Embree's time, most") == (0.25, True)
    assert judged("Python, t, triangle / embreex, triangle, least") == (2.0, True)
    assert judged("Python, two threads / one, geometric mean") == (1.9, True)


def test_a_goal_may_be_a_least_or_a_most() -> None:
    assert Goal("", 1.0, 1.0).is_reached and not Goal("", 0.99, 1.0).is_reached
    assert Goal("", 1.0, 1.0, at_most=True).is_reached and not Goal("", 1.01, 1.0, at_most=True).is_reached
    assert not Goal("", float("nan"), 1.0).is_reached


def test_the_tables_show_every_mesh_kind_and_goal() -> None:
    results = results_of_figures()
    text = describe(results)
    for mesh in ("small", "city", "large"):
        assert re.search(rf"^{mesh} +2\.00 ", text, re.MULTILINE), "Embree's own speeds stand there"
    assert "primary, 1,000,000" in text and "geometric mean" in text
    for goal in goals_of(results):
        assert goal.name in text
    assert describe({"refits": results["refits"]}).count("\n\n") == 1, "what was not measured is left out"


def test_two_runs_are_laid_side_by_side() -> None:
    before, after = results_of_figures(), results_of_figures()
    after["refits"][0]["ns_per_triangle"] *= 1.5
    first, *others = repeated(after, before).splitlines()[3:]
    assert re.fullmatch(r"refit, of Embree's time, most +0\.25 +0\.38 +50\.00", first)
    assert others and all(line.endswith(" 0.00") for line in others)


def test_python_is_measured_with_what_is_there() -> None:
    (mesh,) = [mesh for mesh in generated_meshes.make_all(0.002) if mesh.name == "hair quads"]
    left_out: list[str] = []
    rows = measure_from_python(mesh, (32, 24), 1, left_out)
    assert [row["rays"] for row in rows] == ["primary", "diffuse", "shuffled", "occlusion"]
    for row in rows:
        assert set(PAIRS) <= set(row["one_thread"]) and set(row["wall"]) == {"1", "2"}
        assert min(*row["one_thread"].values(), *row["wall"].values()) > 0.0
        assert bool(left_out) != (set(PAIRS.values()) <= set(row["one_thread"]))


def test_goals_need_the_native_programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with_load(monkeypatch, 0.0)
    words = ["goals.py", "--json", str(tmp_path / "out.json"), "--native", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit, match="trace_bench is not built; `nox -s benchmarks` builds it"):
        goals.main()


def test_goals_save_what_was_measured_on_which_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with_load(monkeypatch, 0.5)
    out = tmp_path / "out.json"
    monkeypatch.setattr(sys, "argv", ["goals.py", "--json", str(out)])
    chosen = options.parse(options.parser("goals"))
    options.save(chosen, results_of_figures())
    saved = json.loads(out.read_text())
    assert saved["machine"]["load_before"] == 0.5 and saved["machine"]["caches"] == machine.caches()
    assert len(saved["rays"]) == len(results_of_figures()["rays"])


PROFILE = """\
events: Ir Dr D1mr Bc Bcm
ob=/somewhere/trace_bench
fn=one
0x1000 3 1 1
0x1004 2 0 0 2 1
calls=4 0x2000
0x1008 500 10 9 8 7
ob=/lib/libm.so
fn=two
0x1000 77
ob=/somewhere/trace_bench
fn=one
0x1000 1
totals: 90 4 2 2 1
"""


def test_a_profile_is_read_without_what_callees_and_libraries_cost() -> None:
    costs = budget.read_costs(PROFILE.splitlines(), "trace_bench")
    expected = {(0x1000, "Ir"): 4, (0x1000, "D1mr"): 1, (0x1004, "Ir"): 2, (0x1004, "Bcm"): 1}
    assert {key: cost for key, cost in costs.items() if cost} == expected
    assert budget.read_totals(PROFILE.splitlines()) == {"Ir": 90, "D1mr": 2, "Bcm": 1}


def test_the_stages_of_a_budget_are_functions_of_the_engine(repository: Path) -> None:
    sources = [*(repository / "native" / "src" / "traverse").iterdir()]
    text = "".join(path.read_text(encoding="utf-8") for path in sources)
    assert [name for name in budget.STAGE_OF if not re.search(rf"\b{name}\b[<(]", text)] == []


def test_a_budget_shows_stages_and_their_sum() -> None:
    stages = {stage: dict.fromkeys(budget.EVENTS, 2.0) for stage in (*budget.STAGES, budget.OTHER)}
    text = budget.describe([{"mesh": "ball", "rays": "diffuse", "strategy": "single", "stages": stages}])
    assert text.count("ball, diffuse, single") == len(budget.EVENTS)
    assert text.count(f" {2.0 * len(stages):.2f}\n") + text.endswith(f" {2.0 * len(stages):.2f}") == len(budget.EVENTS)


def test_a_budget_tells_what_a_visit_takes() -> None:
    stages = {stage: dict.fromkeys(budget.EVENTS, 10.0) for stage in (*budget.STAGES, budget.OTHER)}
    row = {"mesh": "ball", "rays": "diffuse", "stages": stages}
    ours = {**row, "strategy": "single", "nodes_visited": 4.0, "primitives_tested": 5.0}
    *_, line = budget.describe([ours, {**row, "strategy": budget.PEER}]).splitlines()
    # Nodes and their order; leaves; the six other stages; 256 bytes a node.
    assert line.split()[-6:] == ["4.00", "5.00", "5.00", "2.00", "60.00", "1,024.00"]


class RacesOfOneBuild(NativePrograms):
    """Each takes as long as the next of `times` says."""

    def __init__(self, times: list[float]) -> None:
        super().__init__(Path("nowhere"))
        self.times = times

    def run(self, name: str, mesh: Any, arguments: Any, *rest: Any, **options: Any) -> Any:
        time, has_rays = self.times.pop(0), arguments[arguments.index("--ray-rounds") + 1] != "0"
        row = {"name": "auto", "ready_ms": {"median": time, "low": time, "high": time}}
        return {"trees": [row | ({"sah": 3.0} if has_rays else {})]}


def test_short_builds_are_raced_in_several_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = generated_meshes.city(0.001)
    chosen = options.parser("").parse_args(["--json", "unused.json"])
    native = RacesOfOneBuild([4.9, 3.0, 3.2, 3.1, 4.8, 9.0])
    (row,) = goals.measure_builds([mesh], goals.Run(chosen, native, []))
    assert row["ready_ms"]["median"] == 3.2
    assert row["sah"] == 3.0
    assert native.times == [9.0]
    monkeypatch.setattr(goals, "BUILD_SECONDS", 0.0)
    (row,) = goals.measure_builds([mesh], goals.Run(chosen, native, []))
    assert row["ready_ms"]["median"] == 9.0
