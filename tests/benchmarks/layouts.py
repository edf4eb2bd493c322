"""What each layout takes of memory and gives of speed, beside Embree and its compact scenes.

    python tests/benchmarks/layouts.py --mesh dragon.npz --json layouts.json

For each mesh: bytes a triangle, positions and triangles included, and M rays/s of primary and diffuse rays on one
thread, with the best instruction set. The native program runs once a round; figures are of those runs.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import perfect_bvh
from benchmarks import options
from benchmarks.meshes import BenchMesh, subdivided
from benchmarks.native import NativePrograms
from benchmarks.rounds import Spread
from benchmarks.tables import format_table
from tqdm import tqdm

PROGRAM = "trace_bench"
KINDS = ("primary", "diffuse")
PEERS = ("embree", "embree_compact")


def main() -> None:
    """Measure, print the tables, write the JSON."""
    parser = options.parser(__doc__ or "")
    options.add_meshes(parser)
    parser.add_argument(
        "--subdivide", type=int, default=2, metavar="N", help="times the last mesh, for a large one; 0: no"
    )
    chosen = options.parse(parser)
    native = NativePrograms(chosen.native)
    if not native.has(PROGRAM):
        raise SystemExit(native.why_not(PROGRAM))
    results = []
    meshes = options.meshes_of(chosen)
    if chosen.subdivide:
        meshes.append(subdivided(meshes[-1], chosen.subdivide))
    for mesh in tqdm(meshes, unit="mesh"):
        results.append(
            {"name": mesh.name, "triangle_count": len(mesh.triangles), "layouts": measure(mesh, chosen, native)}
        )
        tqdm.write(describe(results[-1]) + "\n", file=sys.stdout)
    options.save(chosen, {"meshes": results})


def measure(mesh: BenchMesh, chosen: argparse.Namespace, native: NativePrograms) -> list[dict[str, Any]]:
    """A row for each layout and each of Embree's."""
    words = ["--rounds", "1", "--kinds", ",".join(KINDS)]
    words += ["--isas", perfect_bvh.active_isa(), "--peers", ",".join(PEERS)]
    words += ["--layouts", "default,compact", "--size", chosen.size, *(["--inside"] if mesh.is_inside else [])]
    rows: dict[str, dict[str, Any]] = {}
    for _ in range(chosen.rounds):
        for run in native.run(PROGRAM, mesh, words):
            name = run["competitor"]
            name = name if name in PEERS else "compact" if "compact" in name else "default"
            row = rows.setdefault(name, {"name": name, "bytes_per_triangle": run["bytes_a_triangle"], "rays": {}})
            row["rays"].setdefault(run["rays"], []).append(run["mrays_per_second"])
    for row in rows.values():
        row["rays"] = {kind: Spread.of(speeds).as_json() for kind, speeds in row["rays"].items()}
    return list(rows.values())


def describe(result: dict[str, Any]) -> str:
    """A table of one mesh."""
    rows = [
        (row["name"], row["bytes_per_triangle"], *(row["rays"][kind]["median"] for kind in KINDS))
        for row in result["layouts"]
    ]
    heads = (f"{result['name']}: {result['triangle_count']:,}", "bytes/tri", *(f"{kind} M rays/s" for kind in KINDS))
    return format_table(heads, rows)


if __name__ == "__main__":
    main()
