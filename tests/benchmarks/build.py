"""What each builder costs and gains, compared with Embree and Blender.

For each mesh and tree: milliseconds to build it and until it can be traced, on one and on all threads; the surface
area heuristic's cost, end-point overlap, bytes a triangle; nodes and triangles that a ray visits and M rays/s, for
primary, diffuse and occlusion rays on one thread. All figures that are compared are measured in turn in one run.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import perfect_bvh
from benchmarks import build_python, options
from benchmarks.build_tables import describe_mesh
from benchmarks.meshes import BenchMesh
from benchmarks.native import NativePrograms
from benchmarks.trees import TREES, as_argument
from tqdm import tqdm

PROGRAM = "build_bench"
TIMES = ("build_ms", "ready_ms", "stage_ms")  # by number of threads


def main() -> None:
    """Measure, print the tables, write the JSON."""
    parser = options.parser(__doc__ or "")
    options.add_meshes(parser)
    options.add_ray_limit(parser)
    parser.add_argument("--trees", nargs="+", choices=TREES, default=list(TREES), metavar="TREE", help="which to build")
    parser.add_argument("--seconds", type=float, default=60.0, help="start no native round of builds after that many")
    parser.add_argument("--threads", nargs="+", type=int, default=thread_counts(), metavar="N", help="that build")
    chosen = options.parse(parser)
    meshes = options.meshes_of(chosen)
    native, left_out = NativePrograms(chosen.native), list[str]()
    if not native.has(PROGRAM):
        left_out.append(native.why_not(PROGRAM))
    results = []
    with tqdm(total=len(meshes), unit="mesh", smoothing=0.0) as bar:
        for mesh in meshes:
            bar.set_description(mesh.name)
            results.append(measure(mesh, chosen, native, left_out, bar))
            tqdm.write(describe_mesh(results[-1]) + "\n", file=sys.stdout)
            bar.n = len(results)
    left_out = sorted(set(left_out))
    for line in left_out:
        print(f"left out: {line}")
    options.save(chosen, {"left_out": left_out, "meshes": results})


def measure(
    mesh: BenchMesh, chosen: argparse.Namespace, native: NativePrograms, left_out: list[str], bar: tqdm[Any]
) -> dict[str, Any]:
    """Everything about one mesh. The bar moves by one in all."""
    share = _Share(bar)
    trees = _native(mesh, chosen, native, share) if native.has(PROGRAM) else _python(mesh, chosen, share)
    share.next_part(0.1, 4.0 * chosen.rounds * 3)
    size = options.size_of(chosen)
    peers = build_python.measure_peers(mesh, size, chosen.rounds, chosen.ray_limit, left_out, share.step)
    return {
        "name": mesh.name,
        "triangle_count": len(mesh.triangles),
        "measured": "native" if native.has(PROGRAM) else "python",
        "trees": trees,
        "from_python": peers,
        "planner": build_python.planner_choices(mesh),
    }


def thread_counts() -> list[int]:
    """One and all."""
    return sorted({1, perfect_bvh.thread_count()})


def _native(mesh: BenchMesh, chosen: argparse.Namespace, native: NativePrograms, share: _Share) -> list[dict[str, Any]]:
    """Rows of the native program, of its runs with one and with all threads together."""
    rows: dict[str, dict[str, Any]] = {}
    trees = [word for name in chosen.trees for word in ("--tree", as_argument(name))]
    for threads in chosen.threads:
        share.next_part(0.9 / len(chosen.threads), 1.0)
        rays = ["--size", chosen.size, "--ray-rounds", str(chosen.rounds if threads == 1 else 0)]
        times = ["--threads", str(threads), "--rounds", str(chosen.rounds), "--seconds", str(chosen.seconds)]
        inside = ["--inside"] if mesh.is_inside else []
        for row in native.run(PROGRAM, mesh, [*trees, *rays, *times, *inside], share.set)["trees"]:
            kept = rows.setdefault(row["name"], {**row, **{key: {} for key in TIMES}})
            for key in TIMES:
                if key in row:
                    kept[key][str(threads)] = row[key]
    return list(rows.values())


def _python(mesh: BenchMesh, chosen: argparse.Namespace, share: _Share) -> list[dict[str, Any]]:
    """The same rows without the native program: no peers, and no times of the binary tree alone."""
    size, count = options.size_of(chosen), chosen.rounds * len(chosen.trees)
    share.next_part(0.4, 3.0 * count)
    rows = build_python.measure_trees(mesh, chosen.trees, size, chosen.rounds, share.step)
    for row in rows.values():
        row |= {key: {} for key in TIMES}
    for threads in chosen.threads:
        share.next_part(0.5 / len(chosen.threads), count)
        builds = build_python.measure_builds(mesh, chosen.trees, chosen.rounds, threads, share.step)
        for name, times in builds.items():
            for key in times:
                rows[name][key][str(threads)] = times[key]
    return [{"name": name, **row} for name, row in rows.items()]


class _Share:
    """Moves a bar by one in all, in parts of known shares."""

    def __init__(self, bar: tqdm[Any]) -> None:
        self._bar, self._start, self._size, self._step = bar, bar.n, 0.0, 0.0

    def next_part(self, size: float, step_count: float) -> None:
        self._start, self._size, self._step = self._start + self._size, size, size / step_count

    def set(self, share: float) -> None:
        self._bar.n = self._start + self._size * share
        self._bar.refresh()

    def step(self) -> None:
        self._bar.update(self._step)


if __name__ == "__main__":
    main()
