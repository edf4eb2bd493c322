"""The tables of goals.py: of each subject, and of the goals."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from benchmarks import goal_figures as figures
from benchmarks.goal_list import goals_of
from benchmarks.python_rays import PAIRS
from benchmarks.tables import Cell, format_table

Row = dict[str, Any]
Results = Mapping[str, Sequence[Row]]


def describe(results: Results) -> str:
    """All tables of the measured figures, the goals last."""
    parts = [text for name, rows in results.items() if rows for text in TABLES[name](rows)]
    return "\n\n".join([*parts, goals(results)])


def goals(results: Results) -> str:
    """The measured figure next to each goal."""
    lines: list[tuple[Cell, ...]] = []
    for goal in goals_of(results):
        bound = f"{'<=' if goal.at_most else '>='} {goal.bound:.2f}"
        lines.append((goal.name, goal.value, bound, "yes" if goal.is_reached else "no", goal.where))
    return "Goals\n" + format_table(("goal", "measured", "wanted", "reached", "where"), lines)


def repeated(results: Results, before: Results) -> str:
    """The difference between the figures of two runs for each goal, the largest first."""
    then = {goal.name: goal.value for goal in goals_of(before)}
    found = [(goal.name, then[goal.name], goal.value) for goal in goals_of(results) if goal.name in then]
    lines: list[tuple[Cell, ...]] = [(name, old, new, 100.0 * (new / old - 1.0)) for name, old, new in found]
    lines.sort(key=lambda line: -abs(float(line[3] or 0.0)))
    return "Beside the other run\n" + format_table(("goal", "then", "now", "per cent"), lines)


def _by_mesh(title: str, values: figures.Ratios, *, has_means: bool = True) -> Iterator[str]:
    """Meshes down, kinds across; last a line of geometric means, unless there may be zeros."""
    if not values:
        return
    kinds = list(dict.fromkeys(kind for _, kind in values))
    lines: list[list[Cell]] = [
        [mesh, *(values.get((mesh, kind)) for kind in kinds)] for mesh in dict.fromkeys(mesh for mesh, _ in values)
    ]
    if has_means:
        means = [figures.geometric_mean(value for (_, each), value in values.items() if each == kind) for kind in kinds]
        lines.append(["geometric mean", *means])
    yield f"{title}\n{format_table(('mesh', *kinds), lines)}"


def _rays(rows: Sequence[Row]) -> Iterator[str]:
    kinds = list(dict.fromkeys((row["rays"], row["batch"]) for row in rows))
    speeds = {
        (row["mesh"], figures.label(row["rays"], row["batch"])): row["mrays_per_second"]
        for row in rows
        if row["competitor"] == "embree"
    }
    yield from _by_mesh("Embree's default, M rays/s; 8,192 rays a call unless a column says otherwise", speeds)
    yield from _by_mesh("Ours / Embree's default", figures.ray_ratios(rows, "embree", kinds))
    yield from _by_mesh("Ours / Embree ROBUST", figures.ray_ratios(rows, "embree_robust", kinds))
    avx2 = figures.ray_ratios(rows, "embree_avx2", kinds, isa="avx2")
    yield from _by_mesh("Ours / Embree's default, both with AVX2 alone", avx2)
    coherent = [(kind, batch) for kind, batch in kinds if kind in ("primary", "tiled", "shadow")]
    yield from _by_mesh("Ours / Embree's 16-wide packets", figures.ray_ratios(rows, "embree_packets", coherent))
    yield from _by_mesh(
        "Answers that differ from Embree's default, of a million rays", _different(rows), has_means=False
    )


def _different(rows: Sequence[Row]) -> figures.Ratios:
    """Returns our number of different answers per million, with the best kernels."""
    return {
        (row["mesh"], row["rays"]): 1e6 * row["different_from_first"] / row["ray_count"]
        for row in rows
        if row["competitor"] == f"{row['isa']}/auto"
    }


def _builds(rows: Sequence[Row]) -> Iterator[str]:
    names = list(dict.fromkeys(row["name"] for row in rows))
    times = {(row["mesh"], row["name"]): row["ready_ms"]["median"] for row in rows}
    yield from _by_mesh("Cold, one thread: ms until rays can be cast", times)
    ratios = {
        (mesh, f"{tree} / {peer.removeprefix('embree_').upper()}"): ratio
        for tree, peer in figures.BUILDS.items()
        for (mesh,), ratio in figures.build_ratios(rows, tree).items()
    }
    yield from _by_mesh("Times as soon as Embree", ratios)
    sizes = {(mesh, name): size for name in names for (mesh,), size in figures.bytes_a_triangle(rows, name).items()}
    yield from _by_mesh("Bytes a triangle, positions and triangles included", sizes)
    speeds = {(mesh, "auto"): value for (mesh,), value in figures.triangles_a_cycle(rows).items()}
    yield from _by_mesh("Million triangles a second, core and GHz, ready to trace", speeds)


def _instances(rows: Sequence[Row]) -> Iterator[str]:
    kinds = {"first": "first build", "commit": "all moved", "primary": "primary", "diffuse": "diffuse"}
    ratios = {kind: figures.instance_ratios(rows, kind) for kind in kinds}
    columns = list(dict.fromkeys((kind, who) for kind, each in ratios.items() for who, _ in each))
    counts: Iterable[int] = dict.fromkeys(row["instances"] for row in rows)
    lines: list[list[Cell]] = [[f"{n:,}", *(ratios[kind].get((who, n)) for kind, who in columns)] for n in counts]
    heads = [f"{kinds[kind]} / {who}" for kind, who in columns]
    table = format_table(("instances", *heads), lines)
    yield f"Instances of {rows[0]['mesh']}: times as soon or as fast as Embree's\n{table}"


def _refits(rows: Sequence[Row]) -> Iterator[str]:
    times = {(row["mesh"], row["method"]): row["ns_per_triangle"] for row in rows}
    yield from _by_mesh("Following a swaying mesh, ns a triangle", times)


def _python(rows: Sequence[Row]) -> Iterator[str]:
    speeds = {(row["mesh"], f"{row['rays']}: {name}"): rate for row in rows for name, rate in row["one_thread"].items()}
    yield from _by_mesh("From Python, one batch, one thread, M rays/s", speeds)
    for ours, peer in PAIRS.items():
        yield from _by_mesh(f"From Python: {ours} / {peer}", figures.python_ratios(rows, ours))
    yield from _by_mesh("From Python: two threads / one, by the wall's clock", figures.thread_ratios(rows))


TABLES = {"rays": _rays, "builds": _builds, "instances": _instances, "refits": _refits, "python": _python}
