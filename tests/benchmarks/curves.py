"""Hair, grass, fur and points, compared with Embree's own curves and spheres and with tubes of triangles.

    python tests/benchmarks/curves.py --json curves.json

A lawn, fur, long hair and a scan, made from seeds (`generated_curves.py`; `--detail` makes them smaller). For each:
rays through ours, our ribbons, Embree's round linear, flat linear and round cubic curves (points:
spheres), and our trees over the same as tubes of six sides (points: octahedra); how soon rays can be cast; bytes a
segment; updates in the wind. All on one thread, from C++: embreex has no curves for Python. Ribbons, the flat and the
cubic ones are other surfaces, for comparison.

The JSON holds `rows`, the output of native/benchmarks/curve_bench.cpp for each shape with its name, and `goals`.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks import generated_curves, options
from benchmarks.native import NativePrograms
from benchmarks.tables import Cell, format_goals, format_table
from tqdm import tqdm

PROGRAM = "curve_bench"
PEER = "embree round"
KINDS = ("primary", "diffuse", "shuffled", "occlusion")
Row = dict[str, Any]


def main() -> None:
    """Measure, print the tables, write the JSON."""
    parser = options.parser(__doc__ or "")
    parser.add_argument("--detail", type=float, default=1.0, metavar="X", help="curves and points, times this")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS), help="of rays")
    parser.add_argument("--visits", action="store_true", help="tell what our rays visit, counted in another run")
    chosen = options.parse(parser)
    native = NativePrograms(chosen.native)
    if not native.has(PROGRAM):
        raise SystemExit(native.why_not(PROGRAM))
    words = ["--rounds", str(chosen.rounds), "--build-rounds", str(chosen.rounds), "--size", chosen.size]
    words += ["--kinds", ",".join(chosen.kinds), *(["--visits"] if chosen.visits else [])]
    rows: list[Row] = []
    for balls in tqdm(generated_curves.make_all(chosen.detail), unit="scene", desc="curves"):
        inside = ["--inside"] if balls.is_inside else []
        rows.append({"name": balls.name, **native.run(PROGRAM, balls, [*words, *inside])})
    goals = judge(rows)
    print(describe(rows) + "\n\n" + format_goals(goals))
    options.save(chosen, {"rows": rows, "goals": goals})


def ray_ratios(row: Row, competitor: str, to: str) -> dict[str, float]:
    """Returns the ratio of speeds by kind of ray."""
    speed = {(ray["rays"], ray["competitor"]): ray["mrays_per_second"] for ray in row["rays"]}
    return {kind: speed[kind, competitor] / speed[kind, to] for kind in KINDS if (kind, competitor) in speed}


def bytes_each(row: Row, competitor: str) -> float | None:
    """Per segment or point; None for a competitor that took no part."""
    of_it = [ray["byte_count"] for ray in row["rays"] if ray["competitor"] == competitor]
    return of_it[0] / row["primitive_count"] if of_it else None


def time_ratio(row: Row, table: str, key: str, to: str) -> float:
    """Returns the ratio of our median time to another's, in a table of builds or refits."""
    medians = {one["competitor"]: one[key]["median"] for one in row[table]}
    return float(medians["ours"] / medians[to])


def judge(rows: list[Row]) -> list[Row]:
    """Each goal, the figure reached, and where the worst figure is."""
    rays = {(row["name"], kind): ratio for row in rows for kind, ratio in ray_ratios(row, "ours", PEER).items()}
    tubes = {(row["name"], kind): ratio for row in rows for kind, ratio in ray_ratios(row, "ours", "tubes").items()}
    size = {(row["name"],): bytes_each(row, "ours") or 0.0 for row in rows}
    soon = {(row["name"],): 1.0 / time_ratio(row, "builds", "ready_ms", PEER) for row in rows}
    refits = {(row["name"],): time_ratio(row, "refits", "ns_a_primitive", PEER) for row in rows}
    return [
        _goal("rays / Embree's round curves and spheres, geometric mean", _mean(rays), 1.25, f"of {len(rays)}"),
        _goal("rays / Embree's round curves and spheres, least", *_least(rays, 1.0)),
        _goal("rays / tubes of six sides, geometric mean", _mean(tubes), 2.0, f"of {len(tubes)}"),
        _goal("bytes a segment or point, most", *_most(size, 40.0), is_most=True),
        _goal("ready / Embree MEDIUM, least", *_least(soon, 1.0)),
        _goal("refit, of Embree's time, most", *_most(refits, 0.5), is_most=True),
    ]


def _mean(ratios: dict[tuple[str, ...], float]) -> float:
    product = 1.0
    for ratio in ratios.values():
        product *= ratio ** (1.0 / len(ratios))
    return product


def _least(values: dict[tuple[str, ...], float], wanted: float) -> tuple[float, float, str]:
    where = min(values, key=lambda key: values[key])
    return values[where], wanted, ", ".join(where)


def _most(values: dict[tuple[str, ...], float], wanted: float) -> tuple[float, float, str]:
    where = max(values, key=lambda key: values[key])
    return values[where], wanted, ", ".join(where)


def _goal(name: str, measured: float, wanted: float, where: str, *, is_most: bool = False) -> Row:
    reached = measured <= wanted if is_most else measured >= wanted
    return {"goal": name, "measured": measured, "wanted": wanted, "reached": reached, "where": where, "most": is_most}


def describe(rows: list[Row]) -> str:
    """Tables of speeds, ratios, builds and updates."""
    speeds: list[list[Cell]] = []
    for row in rows:
        for kind in KINDS:
            of_kind = [ray for ray in row["rays"] if ray["rays"] == kind]
            by = {ray["competitor"]: ray for ray in of_kind}
            if not by:
                continue
            names = (PEER, "embree flat", "ours ribbon", "embree cubic", "tubes", "ours")
            cells: list[Cell] = [by[name]["mrays_per_second"] if name in by else None for name in names]
            ratio = by["ours"]["mrays_per_second"] / by[PEER]["mrays_per_second"]
            visited = [by["ours"].get("nodes_visited"), by["ours"].get("primitives_tested")]
            differ = by["ours"]["different_from_first"] / by["ours"]["ray_count"]
            speeds.append([f"{row['name']}, {kind}", *cells, ratio, 1e6 * differ, *visited])
    others: list[list[Cell]] = []
    for row in rows:
        builds = {one["competitor"]: one["ready_ms"]["median"] for one in row["builds"]}
        refits = {one["competitor"]: one["ns_a_primitive"]["median"] for one in row["refits"]}
        sizes = [bytes_each(row, name) for name in (PEER, "tubes", "ours")]
        cells = [builds[PEER], builds["tubes"], builds["ours"], refits[PEER], refits["ours"], *sizes]
        others.append([f"{row['name']}, {row['primitive_count']:,}", *cells])
    heads = (
        "M rays/s",
        PEER,
        "flat",
        "ours ribbon",
        "cubic",
        "tubes",
        "ours",
        "ours / round",
        "differ, ppm",
        "nodes",
        "tests",
    )
    rest = ("ready, ms", PEER, "tubes", "ours", "refit, ns: round", "ours", "bytes: round", "tubes", "ours")
    return f"{format_table(heads, speeds)}\n\n{format_table(rest, others)}"


if __name__ == "__main__":
    main()
