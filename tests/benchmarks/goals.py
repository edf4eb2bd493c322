"""Compares the engine with its peers and its goals, in one run: rays, builds, instances, refits, Python.

    python tests/benchmarks/goals.py --mesh nefertiti.npz sponza.npz dragon.npz --json goals.json

Measures, on one thread unless a table says otherwise, the given meshes, those that Blender makes (displaced, instanced,
sticks), generated ones (a city and foliage seen from inside, hair of slanted quads) and, for rays and builds, the last
given mesh with sixteen times its triangles. Prints a table of each subject and one of the goals: the figure, the goal,
and whether it is reached. README.md in this folder explains the measurements and the tables.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import perfect_bvh
from benchmarks import generated_meshes, options
from benchmarks.goal_tables import describe, repeated
from benchmarks.machine import gigahertz
from benchmarks.meshes import BenchMesh, MeshError, default_meshes, load, subdivided
from benchmarks.native import NativePrograms
from benchmarks.python_rays import measure_from_python
from benchmarks.trees import as_argument
from tqdm import tqdm

Row = dict[str, Any]
PROGRAMS = ("trace_bench", "build_bench", "instance_bench", "refit_bench")
BATCHES = (8192, 1_000_000)
EMBREE = ("embree", "embree_robust", "embree_avx2", "embree_packets")
TREES = ("auto", "fast", "changing", "spatial")
# Races of builds last this number of seconds, in at most this number of processes: the mean of three builds of a few
# milliseconds can be 20% off, and sometimes all of Embree LOW's builds in one process take half as long again.
BUILD_SECONDS, BUILD_RACES = 8.0, 5
UNLIKE_A_SCENE = "hair"  # of Blender's meshes: tubes; the generated quads are harder


@dataclass(frozen=True)
class Run:
    """The command line, the native programs, and a list of lines about figures that could not be measured."""

    chosen: argparse.Namespace
    native: NativePrograms
    left_out: list[str]


def main() -> None:
    """Measure, print the tables, write the JSON."""
    parser = options.parser(__doc__ or "")
    options.add_named_meshes(parser)
    add = parser.add_argument
    add("--instances", type=int, nargs="+", default=[1000, 10_000, 100_000, 1_000_000], metavar="N")
    add("--subdivide", type=int, default=2, metavar="N", help="times the last given mesh, for a large one; 0: no")
    add("--tables", nargs="+", choices=TABLES, default=list(TABLES), help="which to measure")
    add("--beside", type=Path, metavar="OTHER.json", help="of an earlier run: tell how far this one is from it")
    parser.set_defaults(size="1250x800")  # a million rays
    chosen = options.parse(parser)
    native = NativePrograms(chosen.native)
    for program in PROGRAMS:
        if not native.has(program):
            raise SystemExit(native.why_not(program))
    meshes, left_out = meshes_of(chosen)
    run, results = Run(chosen, native, left_out), dict[str, list[Row]]()
    with tqdm(total=len(chosen.tables), unit="table", smoothing=0.0) as bar:
        for name in chosen.tables:
            bar.set_description(name)
            results[name] = TABLES[name](meshes, run)
            bar.update()
    left_out = list(dict.fromkeys(run.left_out))
    options.save(chosen, {"left_out": left_out, **results})
    print("\n" + describe(results))
    if chosen.beside is not None:
        before = json.loads(chosen.beside.read_text(encoding="utf-8"))
        print("\n" + repeated(results, before))
    for line in left_out:
        print(f"left out: {line}")


def meshes_of(chosen: argparse.Namespace) -> tuple[list[BenchMesh], list[str]]:
    """The given ones first; and a line for each that cannot be had. Ends the program if a given one is among these."""
    try:
        meshes, left_out = [load(path) for path in chosen.mesh or ()], []
    except MeshError as error:
        raise SystemExit(str(error)) from None
    if not meshes:
        left_out.append("the shared meshes, and a large one: name files with --mesh")
    large = [subdivided(meshes[-1], chosen.subdivide)] if meshes and chosen.subdivide else []
    try:
        meshes += [mesh for mesh in default_meshes(chosen.detail) if mesh.name != UNLIKE_A_SCENE]
    except MeshError as error:
        left_out.append(f"displaced, instanced, sticks: {error}")
    return [*meshes, *generated_meshes.make_all(chosen.detail), *large], left_out


def measure_rays(meshes: Sequence[BenchMesh], run: Run) -> list[Row]:
    """Rows of trace_bench: every kind of ray, in small and in large batches; our best kernels and AVX2's."""
    isas = dict.fromkeys((perfect_bvh.active_isa(), *(["avx2"] if "avx2" in perfect_bvh.available_isas() else [])))
    words = ["--rounds", str(run.chosen.rounds), "--size", run.chosen.size, "--batches", ",".join(map(str, BATCHES))]
    words += ["--peers", ",".join(EMBREE), "--isas", ",".join(isas)]
    rows = []
    for mesh in meshes:
        found = run.native.run("trace_bench", mesh, [*words, "--inside" if mesh.is_inside else "--filling"])
        count = len(mesh.triangles)
        rows += [{**row, "mesh": mesh.name, "triangle_count": count, "isa": perfect_bvh.active_isa()} for row in found]
    return rows


def measure_builds(meshes: Sequence[BenchMesh], run: Run) -> list[Row]:
    """Rows of build_bench: cold, until rays can be cast."""
    rows = []
    for mesh in meshes:
        common = {"mesh": mesh.name, "triangle_count": len(mesh.triangles), "gigahertz": gigahertz()}
        rows += [{**row, **common} for row in _race_builds(mesh, run)]
    return rows


def _race_builds(mesh: BenchMesh, run: Run) -> list[Row]:
    """By tree: the row of the first race, with the times of the middle one."""
    words = ["--rounds", str(run.chosen.rounds), "--least-seconds", str(BUILD_SECONDS / BUILD_RACES)]
    words += ["--inside"] if mesh.is_inside else []
    for tree in TREES:
        words += ["--tree", as_argument(tree)]
    start, races = time.monotonic(), list[list[Row]]()
    while not races or (len(races) < BUILD_RACES and time.monotonic() - start < BUILD_SECONDS):
        rays = ["--ray-rounds", "0"] if races else ["--ray-rounds", "1", "--size", "96x64"]
        races.append(run.native.run("build_bench", mesh, [*words, *rays])["trees"])
    times = ([row["ready_ms"] for row in rows] for rows in zip(*races, strict=True))
    middles = [sorted(each, key=lambda spread: spread["median"])[len(each) // 2] for each in times]
    return [{**row, "ready_ms": middle} for row, middle in zip(races[0], middles, strict=True)]


def measure_instances(meshes: Sequence[BenchMesh], run: Run) -> list[Row]:
    """Rows of instance_bench, of the first mesh: first builds, updates, and rays through them."""
    words = ["--counts", ",".join(map(str, run.chosen.instances)), "--layouts", "grid"]
    words += ["--rounds", str(run.chosen.rounds)]
    rows: list[Row] = run.native.run("instance_bench", meshes[0], words)
    return [{**row, "mesh": meshes[0].name} for row in rows]


def measure_refits(meshes: Sequence[BenchMesh], run: Run) -> list[Row]:
    """Rows of refit_bench's swaying mesh."""
    words = ["--rounds", str(max(run.chosen.rounds, 3)), "--ray-rounds", "0"]
    rows = []
    for mesh in meshes:
        found = run.native.run("refit_bench", mesh, words)["sway"]
        rows += [{**row, "mesh": mesh.name, "triangle_count": len(mesh.triangles)} for row in found]
    return rows


def measure_python(meshes: Sequence[BenchMesh], run: Run) -> list[Row]:
    """Rows of python_rays.py."""
    size = options.size_of(run.chosen)
    return [row for mesh in meshes for row in measure_from_python(mesh, size, run.chosen.rounds, run.left_out)]


Measure = Callable[[Sequence[BenchMesh], Run], list[Row]]
TABLES: dict[str, Measure] = {
    "rays": measure_rays,
    "builds": measure_builds,
    "instances": measure_instances,
    "refits": measure_refits,
    "python": measure_python,
}


if __name__ == "__main__":
    main()
