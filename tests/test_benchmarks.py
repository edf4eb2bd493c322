"""Both benchmarks run on a small mesh without the native programs and write their output; no test depends on a time.

Their judge finds the answers that are wrong, and no others.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import perfect_bvh
import pytest
from benchmarks import mesh_edges, peers
from benchmarks.judging import Judge, pick_sample
from benchmarks.meshes import BenchMesh, load, subdivided
from benchmarks.peers import Answers
from benchmarks.rays import Rays
from oracles import meshes
from oracles.brute_force import WorldTriangles, judge

TREES = ["auto", "median", "sweep", "binned", "binned+optimize", "spatial", "fast", "changing"]


@pytest.fixture
def mesh_file(tmp_path: Path) -> Path:
    positions, triangles = meshes.sphere(12, 16)
    path = tmp_path / "ball.npz"
    np.savez(path, positions=positions.astype(np.float32), triangles=triangles)
    return path


def run(repository: Path, script: str, mesh_file: Path, *arguments: str) -> tuple[dict[str, Any], str]:
    """A benchmark's JSON and its printed output."""
    out = mesh_file.parent / "figures" / "out.json"
    command = [sys.executable, str(repository / "tests" / "benchmarks" / script), "--mesh", str(mesh_file)]
    command += ["--json", str(out), "--native", str(mesh_file.parent / "nowhere"), "--rounds", "1"]
    command += ["--size", "24x16", "--ray-limit", "40", "--noisy", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    results = json.loads(out.read_text())
    assert results["machine"]["isa"] in results["machine"]["available_isas"]
    assert {"commit", "processor", "caches", "load_before", "threads", "versions", "time"} <= set(results["machine"])
    assert results["machine"]["processor"] in done.stdout
    assert f"load {results['machine']['load_before']:.2f} before" in done.stdout
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
        assert tree["stage_ms"]["1"]["build"] > 0.0
        assert tree["sah"] > 1.0
        if tree["epo"] is None:
            assert tree["name"] in ("fast", "changing"), "only what is built fast has no binary tree"
        else:
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
            assert 0 < row["wrong"]["judged"] <= 64
        ours = [row for key, row in rows.items() if key.startswith("perfect_bvh")]
        assert all(row["wrong"]["wrong"] == 0 for row in ours), name
        assert name in table


def figures_of(repository: Path, tmp_path: Path, script: str, *arguments: str) -> dict[str, Any]:
    """The JSON of a benchmark that makes its own meshes."""
    out = tmp_path / "out.json"
    command = [sys.executable, str(repository / "tests" / "benchmarks" / script), "--json", str(out), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    figures = json.loads(out.read_text())
    assert figures["machine"]["threads"] >= 1
    return figures


def test_the_benchmark_of_stability(repository, tmp_path):
    figures = figures_of(repository, tmp_path, "stability.py", "--rows", "8", "--rays", "200", "--rounds", "1")
    assert set(figures["motions"]) == {"twist", "explosion", "scale", "shear"}
    for points in figures["motions"].values():
        for row in (row for point in points for row in point["policies"].values()):
            check_spread(row["speed"])
            assert (row["different"], row["wrong"]) == (0, 0)
            assert row["audited"] > 0


def test_the_benchmark_of_accuracy(repository, tmp_path):
    words = ["--rays", "400", "--ray-limit", "50", "--sample", "5", "--rounds", "1", "--size", "24x16", "--noisy"]
    figures = figures_of(repository, tmp_path, "accuracy.py", *words, "--native", str(tmp_path))
    assert [len(figures["sweeps"][name]) for name in ("offset", "scale", "aspect")] == [7, 8, 6]
    for point in (point for points in figures["sweeps"].values() for point in points):
        for aim in ("surface", "vertices"):
            ours = point[aim]["perfect_bvh"]
            assert (ours["missed_per_million"], ours["rays"]) == (0.0, 400), (point["value"], aim)
            assert ours.get("judged_wrong", 0) == 0
    for point in (*figures["grounds"]["flat"], *figures["grounds"]["aslant"]):
        ours = point["t"]["perfect_bvh"]
        assert (ours["missed"], ours["rays"]) == (0, 400) and ours["largest"] <= 2.5e-7, point["value"]
    for point in figures["exact"]["distances"]:
        assert 0 < point["hits"] < figures["exact"]["rays"] == 133
        assert point["answers"]["perfect_bvh"]["wrong_per_million"] == 0.0, point["value"]


def test_no_ray_exactly_at_edges_is_lost(repository, tmp_path, mesh_file):
    words = ["--mesh", str(mesh_file), "--rays", "3000"]
    (mesh,) = figures_of(repository, tmp_path, "mesh_edges.py", *words)["meshes"]
    assert min(mesh["few bits"], mesh["any direction"], mesh["float32"]) > 500
    assert (mesh["lost"], mesh["unlisted"], mesh["odd"]) == (0, 0, 0)
    assert mesh["crossings"] > mesh["past edges"] == 1000


def test_a_ray_that_is_lost_at_an_edge_is_counted(mesh_file):
    """The engine lacks one of two triangles; the judge has both."""
    mesh, random = load(mesh_file), np.random.default_rng(3)
    rays = mesh_edges.aim(mesh, "any direction", 1000, random)
    half = peers.scene_of(BenchMesh("half", mesh.positions, mesh.triangles[::2]))
    lost, unlisted = mesh_edges.lost_rays(mesh, half, rays, mesh_edges.Neighbours(mesh.triangles))
    assert unlisted.all()
    assert 0 < lost.sum() < len(rays.t)
    assert not mesh_edges.is_closed(mesh.triangles[1:])
    with pytest.raises(ArithmeticError, match="does not meet its target"):
        mesh_edges.check_by_fractions(mesh, replace(rays, origins=np.nextafter(rays.origins, np.inf)))


def test_the_benchmark_of_policies(repository, tmp_path):
    pytest.importorskip("bpy", reason="Blender's module is not installed")
    words = ["--policies", "--only", "exploding", "--frames", "3", "--rounds", "1"]
    (animation,) = figures_of(repository, tmp_path, "sync.py", *words)["policies"]
    assert animation["frames"] == [0.0, 1.0, 2.0]
    second = animation["policies"]["rebuild"]["frames"][1]
    assert second["actions"] == {"rebuilt": 1}
    for row in (row for policy in animation["policies"].values() for row in policy["frames"]):
        check_spread(row["all_ms"])
        assert row["all_ms"]["median"] > row["update_ms"]["median"]


def test_the_benchmark_of_shared_trees(repository, tmp_path):
    rows = figures_of(repository, tmp_path, "shared_tree.py", "--counts", "20", "--rounds", "1")["rows"]
    ways = {row["kind"]: {way for way in ("apart", "opened", "together") if way in row} for row in rows}
    both = {"apart", "together"}
    assert ways == {"octahedron": both, "box": both | {"opened"}, "ball": both | {"opened"}}
    for row in rows:
        for way in ways[row["kind"]]:
            assert row[way]["visits"] > 1.0
            for key in ("build_ms", "trace_ms", "edit_ms"):
                check_spread(row[way][key])


def test_subdividing_keeps_a_mesh_whole():
    positions, triangles = meshes.sphere(6, 8)
    mesh = subdivided(BenchMesh("ball", positions.astype(np.float32), triangles), 2, jitter=0.0)
    assert len(mesh.triangles) == 16 * len(triangles)
    sides = np.sort(mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(sides, axis=0, return_counts=True)[1] == 2).all()  # closed, as before


def test_a_missing_mesh_is_named(repository, mesh_file):
    script = repository / "tests" / "benchmarks" / "build.py"
    missing = mesh_file.with_name("none.npz")
    command = [sys.executable, str(script), "--mesh", str(missing), "--json", str(mesh_file.with_name("o.json"))]
    command += ["--noisy"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode != 0
    assert "none.npz: there is no such file" in done.stderr


@pytest.fixture(scope="module")
def judged() -> tuple[Judge, BenchMesh, np.ndarray, Rays, Answers]:
    """A mesh in three places, rays, and the engine's answers."""
    positions, triangles = meshes.soup(300, 4, 0.12)
    mesh = BenchMesh("soup", positions.astype(np.float32), triangles)
    transforms = np.tile(np.eye(4), (3, 1, 1))
    transforms[:, 0, 3] = (-2.0, 0.0, 1.5)
    transforms[1, :3, :3] = [[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.7]]
    scene = perfect_bvh.Scene()
    mesh_id = scene.add_mesh(mesh.positions, mesh.triangles)
    scene.add_instances([mesh_id] * 3, transforms)
    scene.commit()
    rays = Rays("random", *meshes.random_rays(400, 8, 4.0))
    hits = scene.cast_rays(rays.origins, rays.directions)
    answers = Answers(
        hits.t_hit.astype(np.float64), hits.primitive_ids.astype(np.int64), hits.instance_ids.astype(np.int64)
    )
    return Judge(mesh, transforms), mesh, transforms, rays, answers


def test_the_judge_finds_wrong_answers_and_no_others(judged):
    _, mesh, transforms, rays, right = judged
    hit = right.primitive_ids >= 0
    assert 100 < hit.sum() < 380
    late = Answers(right.t * (1.0 + 1e-3), right.primitive_ids, right.instance_ids)
    lost = Answers(np.full(len(rays), np.inf), np.full(len(rays), -1), np.full(len(rays), -1))
    elsewhere = Answers(right.t, right.primitive_ids, np.where(hit, (right.instance_ids + 1) % 3, -1))
    answers = {"right": right, "late": late, "lost": lost, "elsewhere": elsewhere}
    counts = judged[0].count_wrong(rays, answers)
    assert counts["right"].wrong == 0
    for name in ("late", "lost", "elsewhere"):
        assert counts[name].wrong >= 0.98 * hit.sum(), name
        assert counts[name].wrong <= hit.sum() + counts[name].ambiguous, name
    # Looking only at triangles near the ray changes no verdict.
    world = WorldTriangles.of([(i, mesh.positions, mesh.triangles, transforms[i], 1) for i in range(3)])
    for name, each in answers.items():
        verdict = judge(world, rays.origins, rays.directions, each.t, each.instance_ids, each.primitive_ids)
        assert counts[name].wrong == verdict.wrong.sum(), name
        assert counts[name].ambiguous == verdict.ambiguous.sum(), name


def test_the_judge_of_occlusions(judged):
    judge_of_all, _, _, rays, right = judged
    short = Rays("short", rays.origins, rays.directions, 0.5 * float(np.median(right.t)), is_any_hit=True)
    occluded = right.t <= short.t_max
    assert 30 < occluded.sum() < 370
    answers = {
        "right": Answers.of_any(occluded),
        "never": Answers.of_any(np.zeros_like(occluded)),
        "always": Answers.of_any(np.ones_like(occluded)),
    }
    counts = judge_of_all.count_wrong(short, answers)
    assert counts["right"].wrong == 0
    assert occluded.sum() - counts["never"].ambiguous <= counts["never"].wrong <= occluded.sum()
    assert (~occluded).sum() - counts["always"].ambiguous <= counts["always"].wrong <= (~occluded).sum()
    assert counts["never"].wrong > 20
    assert counts["always"].wrong > 20


def test_samples_are_of_blocks_of_neighbours():
    rays = Rays("line", np.arange(3000, dtype=np.float32).reshape(-1, 3), np.ones((1000, 3), np.float32))
    picked = pick_sample(rays, 256)
    assert len(picked) == 256
    assert (np.diff(picked.origins[:, 0]).reshape(-1)[:63] == 3.0).all()
    assert picked.origins[0, 0] == 0.0
    assert picked.origins[-1, 0] == rays.origins[-1, 0]
    assert pick_sample(rays, 5000) is rays
    assert len(pick_sample(rays, 7)) == 7


@pytest.mark.parametrize(("extension", "operator"), [("ply", "ply_export"), ("obj", "obj_export")])
def test_meshes_from_files_that_blender_reads(tmp_path: Path, extension: str, operator: str):
    bpy = pytest.importorskip("bpy", reason="Blender's module is not installed")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    path = tmp_path / f"cube.{extension}"
    getattr(bpy.ops.wm, operator)(filepath=str(path))
    mesh = load(path)
    assert (mesh.name, len(mesh.triangles)) == ("cube", 12)
    assert np.allclose(np.abs(mesh.positions), 1.0)
    assert mesh.triangles.max() < len(mesh.positions)


def test_blenders_meshes_are_the_same_in_every_run():
    pytest.importorskip("bpy", reason="Blender's module is not installed")
    from benchmarks.meshes import default_meshes

    first, second = default_meshes(0.01), default_meshes(0.01)
    assert [mesh.name for mesh in first] == ["displaced", "instanced", "hair", "sticks"]
    for one, other in zip(first, second, strict=True):
        assert len(one.triangles) > 50, one.name
        assert np.array_equal(one.positions, other.positions), one.name
        assert np.array_equal(one.triangles, other.triangles), one.name
        assert np.isfinite(one.positions).all(), one.name
        assert 0 <= one.triangles.min() <= one.triangles.max() < len(one.positions), one.name


def test_scans_are_measured_beside_blenders_own_rays(repository: Path, tmp_path: Path) -> None:
    pytest.importorskip("bpy")
    out = tmp_path / "scan.json"
    command = [sys.executable, str(repository / "tests" / "benchmarks" / "scan.py"), "--json", str(out)]
    command += ["--scene", "gears", "--rounds", "1", "--ray-limit", "50"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    rows = json.loads(out.read_text())["rows"]
    assert [row["pattern"] for row in rows] == ["camera", "lidar"]
    for row in rows:
        assert row["rays"] >= row["points"] > 1000
        assert row["blender_rays"] == 50
        assert row["ours_wrong"] == 0
        assert row["scan_mrays"] > 0.0
        assert row["times_as_fast"] > 0.0


def test_converged_images_are_compared_with_cycles(repository: Path, tmp_path: Path) -> None:
    pytest.importorskip("bpy", reason="Blender's module is not installed")
    words = ["--scenes", "gears", "--size", "96", "--samples", "32"]
    (scene,) = figures_of(repository, tmp_path, "converged.py", *words)["scenes"]
    assert scene["name"] == "gears" and len(scene["mean"]) == 3
    assert all(abs(off) < 0.03 for off in scene["mean"])
    for kind in ("pixels", "blocks"):
        assert 0.0 < scene[kind]["p50"] < scene[kind]["p95"]
    assert scene["blocks"]["p95"] < 0.5 * scene["pixels"]["p95"], "most of it is noise"


def test_the_first_image_is_timed_beside_cycles(repository: Path, tmp_path: Path) -> None:
    pytest.importorskip("bpy", reason="Blender's module is not installed")
    words = ["--scenes", "gears", "--size", "64", "--rounds", "2"]
    figures = figures_of(repository, tmp_path, "first_image.py", *words)
    (scene,) = figures["scenes"]
    runs = {run["name"]: run for run in scene["runs"]}
    assert list(runs) == ["ours", "ours, denoised", "Cycles", "Cycles, denoised"]
    for name, run in runs.items():
        for key in ("engine", "engine_cpu", "blender"):
            check_spread(run[key])
        assert ("read" in run) == name.startswith("ours")
    for name in ("ours", "ours, denoised"):
        parts = {key: runs[name]["first"][key] for key in ("read", "build", "trace", "denoise", "rest")}
        assert sum(parts.values()) == pytest.approx(runs[name]["first"]["engine"])
        assert (parts["denoise"] > 0.0) == (name != "ours")
        assert min(parts["read"], parts["build"], parts["trace"], parts["rest"], runs[name]["first"]["save"]) > 0.0
    for pair, (ours, theirs) in {"raw": ("ours", "Cycles"), "denoised": ("ours, denoised", "Cycles, denoised")}.items():
        share = runs[ours]["engine"]["median"] / runs[theirs]["engine"]["median"]
        assert scene["share_of_cycles"][pair]["engine"] == pytest.approx(share)


@pytest.mark.parametrize(
    ("script", "constant", "source", "name"),
    [
        ("build_python.py", "COMMITS_OF_A_STATIC_TREE", "blas/make_blas.cpp", "kStaticCommits"),
    ],
)
def test_what_benchmarks_repeat_of_the_engine_is_the_engines(
    repository: Path, script: str, constant: str, source: str, name: str
) -> None:
    here = (repository / "tests" / "benchmarks" / script).read_text(encoding="utf-8")
    there = (repository / "native" / "src" / source).read_text(encoding="utf-8")
    (repeated,) = re.findall(rf"^{constant} = ([\d.]+)", here, re.MULTILINE)
    (original,) = re.findall(rf"constexpr \w+ {name} = ([\d.]+)", there)
    assert float(repeated) == float(original)


def test_the_soak_that_is_kept_was_long_and_found_nothing(repository: Path) -> None:
    kept = json.loads((repository / "tests" / "benchmarks" / "results" / "soak.json").read_text(encoding="utf-8"))
    assert kept["steps"] >= 20_000
    assert kept["differences"] == []
    middles = [middle for middle, _ in kept["resident_megabytes"]]
    assert middles[-1] < 1.01 * middles[len(middles) // 2], "memory was not flat"
