"""Ratios to peers, of the rows that goals.py measures. Larger is better for ours, unless a name says otherwise."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from benchmarks.python_rays import PAIRS

Row = dict[str, Any]
Ratios = Mapping[Any, float]  # by mesh and kind, or by the columns in which a subject's rows differ

SMALL, MILLION = 8192, 1_000_000  # rays a call
KINDS = (("primary", MILLION), ("diffuse", SMALL), ("shuffled", SMALL), ("occlusion", SMALL))  # that goals speak of
COHERENT = (("tiled", SMALL), ("shadow", SMALL))
LARGE = 2_000_000  # triangles: judged apart
BUILDS = {"auto": "embree_medium", "fast": "embree_low", "changing": "embree_low", "spatial": "embree_high"}
FEW_SHARED = ("foliage", "hair quads")  # meshes whose triangles share few vertices


def geometric_mean(values: Iterable[float]) -> float:
    logarithms = [math.log(value) for value in values]
    return math.exp(sum(logarithms) / len(logarithms)) if logarithms else math.nan


def label(kind: str, batch: int) -> str:
    """A column's head: the kind of ray, and how many are cast a call unless that is SMALL."""
    return kind if batch == SMALL else f"{kind}, {batch:,}"


def ray_ratios(
    rows: Sequence[Row], peer: str, kinds: Iterable[tuple[str, int]] = KINDS, isa: str | None = None
) -> Ratios:
    """By mesh and label. isa: of ours; the best that was measured, if None. Empty where the peer or isa was not."""
    speeds = {(row["mesh"], row["rays"], row["batch"], row["competitor"]): row["mrays_per_second"] for row in rows}
    result = {}
    for mesh, isa_of_mesh in {row["mesh"]: row["isa"] for row in rows}.items():
        for kind, batch in kinds:
            ours = speeds.get((mesh, kind, batch, f"{isa or isa_of_mesh}/auto"))
            theirs = speeds.get((mesh, kind, batch, peer))
            if ours is not None and theirs is not None:
                result[mesh, label(kind, batch)] = ours / theirs
    return result


def is_large(row: Row) -> bool:
    return int(row["triangle_count"]) >= LARGE


def build_ratios(rows: Sequence[Row], tree: str) -> Ratios:
    """By mesh: how much sooner a tree of ours is ready than Embree's of the same kind."""
    times = {(row["mesh"], row["name"]): row["ready_ms"]["median"] for row in rows}
    pairs = ((mesh, times[mesh, name], times.get((mesh, BUILDS[tree]))) for mesh, name in times if name == tree)
    return {(mesh,): theirs / ours for mesh, ours, theirs in pairs if theirs is not None}


def bytes_a_triangle(rows: Sequence[Row], tree: str = "auto") -> Ratios:
    """By mesh, positions and triangles included."""
    return {(row["mesh"],): row["ready_byte_count"] / row["triangle_count"] for row in rows if row["name"] == tree}


def triangles_a_cycle(rows: Sequence[Row]) -> Ratios:
    """By mesh: million triangles in a second of one thread and a GHz, ready to trace, of `auto`."""
    return {
        (row["mesh"],): 1e-3 * row["triangle_count"] / row["ready_ms"]["median"] / row["gigahertz"]
        for row in rows
        if row["name"] == "auto" and row["gigahertz"]
    }


def instance_ratios(rows: Sequence[Row], kind: str) -> dict[tuple[str, int], float]:
    """By peer and number of instances. kind: "first" or "commit", how much sooner ours are ready; or a kind of ray."""
    values: dict[tuple[str, int], float] = {}
    for row in rows:
        if row["kind"] == kind:
            value = row.get("mrays_per_second") or 1.0 / (row["set_ms"] + row["commit_ms"])
            values[row["competitor"], row["instances"]] = value
    return {(who, count): values["ours", count] / value for (who, count), value in values.items() if who != "ours"}


def to_the_best_peer(ratios: Mapping[tuple[str, int], float]) -> dict[int, float]:
    """By number of instances: the ratio to the fastest of Embree's methods."""
    return {count: min(ratio for (_, each), ratio in ratios.items() if each == count) for _, count in ratios}


def refit_shares(rows: Sequence[Row]) -> Ratios:
    """By mesh: our refit's time as a share of Embree's. Less is better."""
    times = {(row["mesh"], row["method"]): row["ns_per_triangle"] for row in rows}
    names = dict.fromkeys(row["mesh"] for row in rows)
    return {(name,): times[name, "refit"] / times[name, "embree refit"] for name in names}


def python_ratios(rows: Sequence[Row], ours: str) -> Ratios:
    """By mesh and kind, to embreex; ours: a key of PAIRS."""
    return {
        (row["mesh"], row["rays"]): row["one_thread"][ours] / row["one_thread"][PAIRS[ours]]
        for row in rows
        if PAIRS[ours] in row["one_thread"]
    }


def thread_ratios(rows: Sequence[Row]) -> Ratios:
    """By mesh and kind: two threads to one, by the wall's clock."""
    return {(row["mesh"], row["rays"]): row["wall"]["2"] / row["wall"]["1"] for row in rows}
