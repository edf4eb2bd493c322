"""Builders and rays as Python sees them: without the native benchmark, and for peers that only Python has."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import perfect_bvh
from benchmarks import peers
from benchmarks.meshes import BenchMesh
from benchmarks.rays import Rays, make_rays
from benchmarks.rounds import Spread, run_rounds, thread_seconds, wall_seconds
from benchmarks.trees import config_of, usage_of

Tell = Callable[[], object]
# The number of rays cast at a tree before its mesh changes; the planner expects a static tree to last this many
# commits.
RAY_COUNTS = tuple(round(10.0 ** (halves / 2.0)) for halves in range(6, 19))
COMMITS_OF_A_STATIC_TREE = 4  # kStaticCommits in native/src/blas/make_blas.cpp


def milliseconds(seconds: list[float]) -> dict[str, float]:
    return Spread.of([1e3 * value for value in seconds]).as_json()


def measure_builds(mesh: BenchMesh, trees: list[str], rounds: int, thread_count: int, tell: Tell) -> dict[str, Any]:
    """Returns, by tree, milliseconds from a mesh to a scene ready to trace, and those of the reported stages."""
    scenes: dict[str, perfect_bvh.Scene] = {}
    reports: dict[str, list[perfect_bvh.CommitReport]] = {name: [] for name in trees}

    def prepare(name: str) -> None:
        scenes[name] = perfect_bvh.Scene()
        build, usage = config_of(name), usage_of(name)
        mesh_id = scenes[name].add_mesh(mesh.positions, mesh.triangles, build=build, usage=usage)
        scenes[name].add_instance(mesh_id)

    clock = thread_seconds if thread_count == 1 else wall_seconds
    commits = {name: (lambda name=name: reports[name].append(scenes[name].commit())) for name in trees}
    perfect_bvh.set_thread_count(thread_count)
    seconds = run_rounds(commits, rounds, clock, tell, prepare)
    perfect_bvh.set_thread_count(0)
    return {name: {"ready_ms": milliseconds(seconds[name]), "stage_ms": median_stages(reports[name])} for name in trees}


def median_stages(reports: list[perfect_bvh.CommitReport]) -> dict[str, float]:
    """Returns the stages' median wall-clock times."""
    stages = {name: [report.mesh_stages[name] for report in reports] for name in ("build", "optimize", "collapse")}
    stages["top level"] = [report.top_level_milliseconds for report in reports]
    return {name: float(np.median(times)) for name, times in stages.items()}


def measure_trees(mesh: BenchMesh, trees: list[str], size: tuple[int, int], rounds: int, tell: Tell) -> dict[str, Any]:
    """Quality and memory of each tree, and the cost of rays in it."""
    scenes = {name: peers.scene_of(mesh, config_of(name), usage_of(name)) for name in trees}
    rows: dict[str, Any] = {}
    for name, scene in scenes.items():
        tree = scene.statistics(detailed=True).meshes[0]
        rows[name] = {
            **{key: getattr(tree, key) for key in ("sah", "epo", "depth", "leaf_count_variability", "sibling_overlap")},
            **{key: getattr(tree, key) for key in ("reference_count", "node_count")},
            "ready_byte_count": tree.geometry_byte_count + tree.wide_byte_count,
            "rays": {},
        }
    for rays in make_rays(mesh, *size):
        if rays.name == "shuffled":
            continue
        tracers = {name: peers.ours(scene, name) for name, scene in scenes.items()}
        for name, rates in measure_rays(list(tracers.values()), rays, rounds, tell).items():
            rows[name]["rays"][rays.name] = {**rates, **count_visits(scenes[name], rays)}
    return rows


def measure_rays(tracers: list[peers.Peer], rays: Rays, rounds: int, tell: Tell) -> dict[str, dict[str, Any]]:
    """M rays/s of each, on one thread, interleaved."""
    parts = {tracer.name: rays.pick(slice(tracer.ray_limit)) for tracer in tracers}
    calls = {tracer.name: (lambda tracer=tracer: tracer.cast(parts[tracer.name])) for tracer in tracers}
    rows = {}
    for name, seconds in run_rounds(calls, rounds, tell=tell).items():
        spread = Spread.of([1e-6 * len(parts[name]) / value for value in seconds])
        rows[name] = {
            "ray_count": len(parts[name]),
            "mrays_per_second": spread.median,
            "rounds": spread.as_json(),
        }
    return rows


def planner_choices(mesh: BenchMesh) -> list[dict[str, Any]]:
    """Which builder the engine takes, for each of many numbers of rays that the tree will be cast at in all."""
    scene = perfect_bvh.Scene()
    mesh_id = scene.add_mesh(mesh.positions, mesh.triangles)
    scene.add_instance(mesh_id)
    rows = []
    for rays in RAY_COUNTS:
        scene.replace_mesh(mesh_id, mesh.positions, mesh.triangles)
        (report,) = scene.commit(expected_rays=max(1, rays // COMMITS_OF_A_STATIC_TREE)).meshes
        rows.append({"rays": rays, "builder": report.builder, "reason": report.reason})
    return rows


def count_visits(scene: perfect_bvh.Scene, rays: Rays) -> dict[str, float]:
    """Nodes and triangles a ray; of occlusion rays, to the first hit rather than to any."""
    fields = ("nodes_visited", "primitives_tested")
    hits = scene.cast_rays(rays.origins, rays.directions, t_min=0.0, t_max=rays.t_max, fields=fields)
    return {name: float(np.mean(getattr(hits, name))) for name in fields}


def measure_peers(
    mesh: BenchMesh, size: tuple[int, int], rounds: int, ray_limit: int, left_out: list[str], tell: Tell
) -> list[dict[str, Any]]:
    """This engine, embreex and BVHTree, each as a script would use it: build and rays."""
    makers: dict[str, Callable[[], peers.Peer]] = {
        "perfect_bvh": lambda: peers.ours(peers.scene_of(mesh, config_of("binned")), "perfect_bvh"),
        "embreex": lambda: peers.embreex(mesh),
        "BVHTree": lambda: peers.bvh_tree(mesh, ray_limit),
    }
    tracers = {}
    for name, make in makers.items():
        try:
            tracers[name] = make()
        except ImportError as error:
            left_out.append(f"{name}: {error}")
    builds = {name: make for name, make in makers.items() if name in tracers}
    if "BVHTree" in builds:
        lists = peers.as_lists(mesh)
        builds["BVHTree"] = lambda: peers.make_bvh_tree(*lists)
    rows = {name: {"name": name, "rays": {}} for name in tracers}
    for name, seconds in run_rounds(builds, rounds, tell=tell).items():
        rows[name]["ready_ms"] = milliseconds(seconds)
    for rays in make_rays(mesh, *size):
        if rays.name != "shuffled":
            for name, rates in measure_rays(list(tracers.values()), rays, rounds, tell).items():
                rows[name]["rays"][rays.name] = rates
    return list(rows.values())
