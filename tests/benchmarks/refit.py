"""The cost of following a mesh that deforms, and of rays afterwards, compared with Embree's refits.

    python tests/benchmarks/refit.py --mesh dragon.npz --json refit.json

For each mesh: nanoseconds a triangle to refit the tree of a swaying mesh, for a whole commit, and for Embree's REFIT;
then the mesh twisted about its longest axis by 0.1, 1.5 and 2 pi radians: the time of each method of updating the tree,
and the rays per second through the updated tree, as a share of those through a new tree of the same engine. All figures
that are compared are measured in turn in one run, on one thread.

The JSON holds `rows`, all with the keys mesh, triangle_count, isa, threads, twist (radians; null: the swaying mesh),
method and ns_per_triangle. Rows of the swaying mesh have ns_low and ns_high, those of commits `actions` (how often the
scene did what). Rows of twists have rays_per_second_ratio (of all rays), primary_ratio, diffuse_ratio, and wrong of
`judged` answers, by the double-precision judge; ours have `different` too: of all rays those whose answers differ in
any bit from a new tree's.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks import options
from benchmarks.native import NativePrograms
from benchmarks.tables import Cell, format_table

PROGRAM = "refit_bench"
PEER = "embree refit"
Row = dict[str, Any]


def main() -> None:
    """Measure, print the tables, write the JSON."""
    parser = options.parser(__doc__ or "")
    options.add_meshes(parser)
    parser.add_argument("--twists", default="0.1,1.5,6.2831853", metavar="A,B", help="radians")
    chosen = options.parse(parser)
    native = NativePrograms(chosen.native)
    if not native.has(PROGRAM):
        raise SystemExit(native.why_not(PROGRAM))
    words = ["--rounds", str(chosen.rounds), "--ray-rounds", str(chosen.rounds), "--size", chosen.size]
    words += ["--twists", chosen.twists]
    rows: list[Row] = []
    for mesh in options.meshes_of(chosen):
        new = rows_of(mesh.name, native.run(PROGRAM, mesh, words))
        print(describe(mesh.name, new) + "\n")
        rows += new
    options.save(chosen, {"rows": rows})


def rows_of(mesh: str, result: dict[str, Any]) -> list[Row]:
    """The rows that the native program prints for one mesh, one at a time."""
    common = {"mesh": mesh, **{key: result[key] for key in ("triangle_count", "isa", "threads")}}
    return [{**common, "twist": None, **row} for row in (*result.get("sway", ()), *result["twists"])]


def describe(mesh: str, rows: Sequence[Row]) -> str:
    """Two tables of one mesh."""
    sway = [row for row in rows if row["twist"] is None]
    peer = next(row["ns_per_triangle"] for row in sway if row["method"] == PEER)
    refits: list[tuple[Cell, ...]] = [
        (row["method"], row["ns_per_triangle"], row["ns_per_triangle"] / peer) for row in sway
    ]
    keys = ("method", "twist", "ns_per_triangle", "primary_ratio", "diffuse_ratio", "wrong", "judged")
    twists = [tuple(row[key] for key in keys) for row in rows if row["twist"] is not None]
    heads = ("update after a twist", "radians", "ns/triangle", "primary", "diffuse", "wrong", "of")
    return "\n\n".join(
        (
            f"{mesh}: {rows[0]['triangle_count']:,} triangles",
            format_table(("following a swaying mesh", "ns/triangle", "of Embree's refit"), refits),
            format_table(heads, twists),
        )
    )


if __name__ == "__main__":
    main()
