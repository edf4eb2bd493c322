"""The builders' figures as tables for the console."""

from __future__ import annotations

from typing import Any

from benchmarks.tables import Cell, format_table

KINDS = ("primary", "diffuse", "occlusion")
BASE = "embree_medium"  # speeds are ratios to this one, where it took part


def describe_mesh(result: dict[str, Any]) -> str:
    """Everything about one mesh."""
    triangles, trees = result["triangle_count"], result["trees"]
    parts = [
        f"{result['name']}: {triangles:,} triangles, measured from {result['measured']} code\n",
        _builds(trees, triangles),
        "Stages, ms by the wall clock:\n" + _stages(trees),
        _rays(trees),
        *_lecture(trees),
        "From Python, one thread:\n" + _from_python(result["from_python"]),
    ]
    return "\n\n".join(parts)


def _builds(trees: list[dict[str, Any]], triangles: int) -> str:
    threads = sorted({count for tree in trees for count in tree["ready_ms"]}, key=int)
    heads = ["tree", *(f"{what} ms, {count} thr." for what in ("build", "ready") for count in threads)]
    heads += ["faster", "M tri/s", "SAH", "EPO", "depth", "refs/tri", "bytes/tri"]
    rows: list[list[Cell]] = []
    for tree in trees:
        ready = {count: tree["ready_ms"][count]["median"] for count in threads}
        build = [tree.get("build_ms", {}).get(count, {}).get("median") for count in threads]
        references = tree.get("reference_count")
        rows.append(
            [
                tree["name"],
                *build,
                *ready.values(),
                ready[threads[0]] / ready[threads[-1]] if len(threads) > 1 else None,
                1e-3 * triangles / ready[threads[0]],
                tree.get("sah"),
                tree.get("epo"),
                tree.get("depth"),
                references / triangles if references is not None else None,
                tree["ready_byte_count"] / triangles,
            ]
        )
    return format_table(heads, rows)


def _stages(trees: list[dict[str, Any]]) -> str:
    ours = [tree for tree in trees if tree["stage_ms"]]
    columns = [(count, stage) for count, stages in ours[0]["stage_ms"].items() for stage in stages]
    heads = ["tree", *(f"{stage}, {count} thr." for count, stage in columns)]
    rows = [[tree["name"], *(tree["stage_ms"][count][stage] for count, stage in columns)] for tree in ours]
    return format_table(heads, rows)


def _rays(trees: list[dict[str, Any]]) -> str:
    base = next((tree for tree in trees if tree["name"] == BASE), None)
    kinds = [kind for kind in KINDS if kind in trees[0]["rays"]]
    heads = ["tree"]
    for kind in kinds:
        heads += [f"{kind}: M rays/s", "ratio", "nodes", "tri."]
    rows: list[list[Cell]] = []
    for tree in trees:
        row: list[Cell] = [tree["name"]]
        for kind in kinds:
            rays = tree["rays"][kind]
            speed = rays["mrays_per_second"]
            ratio = speed / base["rays"][kind]["mrays_per_second"] if base else None
            row += [speed, ratio, rays.get("nodes_visited"), rays.get("primitives_tested")]
        rows.append(row)
    return format_table(heads, rows)


def _lecture(trees: list[dict[str, Any]]) -> list[str]:
    """The lecture's statements next to the measured figures."""
    named = {tree["name"]: tree["rays"] for tree in trees}
    if "median" not in named or "sweep" not in named:
        return []
    lines = ["The heuristic (sweep) against the median split; the lecture: intersections halved, speed about doubled:"]
    for kind, naive in named["median"].items():
        better = named["sweep"][kind]
        tests = better["primitives_tested"] / naive["primitives_tested"]
        visits = better["nodes_visited"] / naive["nodes_visited"]
        speed = better["mrays_per_second"] / naive["mrays_per_second"]
        lines.append(f"  {kind}: triangles x {tests:.2f}, nodes x {visits:.2f}, speed x {speed:.2f}")
    return ["\n".join(lines)]


def _from_python(peers: list[dict[str, Any]]) -> str:
    kinds = list(peers[0]["rays"])
    heads = ["peer", "ready ms", *(f"{kind}: M rays/s" for kind in kinds)]
    rows = [
        [peer["name"], peer["ready_ms"]["median"], *(peer["rays"][kind]["mrays_per_second"] for kind in kinds)]
        for peer in peers
    ]
    return format_table(heads, rows)
