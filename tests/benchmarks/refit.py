"""What it costs to follow a mesh that deforms, and what rays then cost, beside Embree's refits.

    python tests/benchmarks/refit.py --mesh dragon.npz --json refit.json

For each mesh: nanoseconds a triangle to refit the tree of a swaying mesh, for a whole commit, and for Embree's REFIT;
then the mesh twisted about its longest axis by 0.1, 1.5 and 2 pi radians: what each way of updating the tree takes, and
M rays/s through what it leaves, as a share of those through a new tree. Whatever is compared is measured in turn in one
run, on one thread.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks import options
from benchmarks.native import NativePrograms
from benchmarks.tables import format_table

PROGRAM = "refit_bench"
KINDS = ("primary", "diffuse")  # of rays


def main() -> None:
    """Measure, print the tables, write the JSON."""
    chosen = options.parser(__doc__ or "").parse_args()
    native = NativePrograms(chosen.native)
    if not native.has(PROGRAM):
        raise SystemExit(native.why_not(PROGRAM))
    results = []
    rounds = ["--rounds", str(chosen.rounds), "--ray-rounds", str(chosen.rounds), "--size", chosen.size]
    for mesh in options.meshes_of(chosen):
        results.append({"name": mesh.name, **native.run(PROGRAM, mesh, rounds)})
        print(describe(results[-1]) + "\n")
    options.save(chosen, {"meshes": results})


def describe(result: dict[str, Any]) -> str:
    """Two tables of one mesh."""
    embree = next(row for row in result["refits"] if row["name"] == "embree_refit")["ns_per_triangle"]["median"]
    medians = {row["name"]: row["ns_per_triangle"]["median"] for row in result["refits"]}
    refits = [(name, median, median / embree) for name, median in medians.items()]
    twists = []
    for twist in result["twists"]:
        rebuilt = twist["updates"][0]
        for row in twist["updates"]:
            shares = (row[f"{kind}_mrays_per_second"] / rebuilt[f"{kind}_mrays_per_second"] for kind in KINDS)
            twists.append((row["name"], twist["radians"], row["ns_per_triangle"], *shares))
    return "\n\n".join(
        (
            f"{result['name']}: {result['triangle_count']:,} triangles",
            format_table(("refit of a swaying mesh", "ns/triangle", "of Embree's"), refits),
            format_table(("update after a twist", "radians", "ns/triangle", *KINDS), twists),
        )
    )


if __name__ == "__main__":
    main()
