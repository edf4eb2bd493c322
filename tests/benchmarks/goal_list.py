"""The goals, and the figure measured for each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks import goal_figures as figures
from benchmarks.python_rays import PAIRS

Results = Mapping[str, Sequence[dict[str, Any]]]


@dataclass(frozen=True)
class Goal:
    """value: the measured figure, which must be at least, or at most, `bound`. where: it was measured."""

    name: str
    value: float
    bound: float
    where: str = ""
    at_most: bool = False

    @property
    def is_reached(self) -> bool:
        return self.value <= self.bound if self.at_most else self.value >= self.bound


def goals_of(results: Results) -> list[Goal]:
    """Returns the goals that have measured figures."""
    return [goal for name, goals in GOALS.items() if results.get(name) for goal in goals(results[name])]


def _mean(name: str, values: figures.Ratios, bound: float) -> Iterator[Goal]:
    if values:
        yield Goal(f"{name}, geometric mean", figures.geometric_mean(values.values()), bound, f"of {len(values)}")


def _worst(name: str, values: figures.Ratios, bound: float, *, at_most: bool = False) -> Iterator[Goal]:
    if values:
        where = (max if at_most else min)(values, key=lambda key: values[key])
        named = ", ".join(where) if isinstance(where, tuple) else f"{where:,}"
        yield Goal(f"{name}, {'most' if at_most else 'least'}", values[where], bound, named, at_most)


def _of_rays(rows: Sequence[dict[str, Any]]) -> Iterator[Goal]:
    usual, large = [row for row in rows if not figures.is_large(row)], [row for row in rows if figures.is_large(row)]
    default, robust = figures.ray_ratios(usual, "embree"), figures.ray_ratios(usual, "embree_robust")
    yield from _mean("rays / Embree's default", default, 1.35)
    yield from _worst("rays / Embree's default", default, 1.05)
    yield from _mean("rays / Embree ROBUST", robust, 1.7)
    avx2 = figures.ray_ratios(usual, "embree_avx2", isa="avx2")
    yield from _mean("rays / Embree's default, AVX2 alone", avx2, 1.25)
    yield from _worst("rays / Embree's default, AVX2 alone", avx2, 1.0)
    yield from _mean("rays / Embree's default, 2 million triangles or more", figures.ray_ratios(large, "embree"), 1.5)
    coherent = figures.ray_ratios(rows, "embree_packets", figures.COHERENT)
    yield from _worst("coherent rays / Embree's 16-wide packets", coherent, 1.0)
    # The rest of a ray's cost where the tree costs little: 80 ns where Embree takes 95, and 50 where it takes 60.
    for kind, bound in (("diffuse", 95 / 80), ("occlusion", 60 / 50)):
        short = {key: value for key, value in default.items() if key == ("city", kind)}
        yield from _worst(f"short rays, {kind} / Embree's default", short, bound)


def _of_builds(rows: Sequence[dict[str, Any]]) -> Iterator[Goal]:
    for tree, bound in (("auto", 1.5), ("fast", 1.3), ("changing", 1.3), ("spatial", 1.5)):
        peer = figures.BUILDS[tree].removeprefix("embree_").upper()
        yield from _worst(f"{tree} ready / Embree {peer}", figures.build_ratios(rows, tree), bound)
    largest = max(rows, key=lambda row: row["triangle_count"])["mesh"]
    cycles = {key: value for key, value in figures.triangles_a_cycle(rows).items() if key == (largest,)}
    yield from _worst("million triangles a second, core and GHz, ready", cycles, 0.9)
    sizes = figures.bytes_a_triangle(rows)
    few = {key: value for key, value in sizes.items() if key[0] in figures.FEW_SHARED}
    shared = {key: value for key, value in sizes.items() if key not in few}
    yield from _worst("bytes a triangle", shared, 60.0, at_most=True)
    yield from _worst("bytes a triangle that shares few vertices", few, 80.0, at_most=True)


def _of_instances(rows: Sequence[dict[str, Any]]) -> Iterator[Goal]:
    first = figures.to_the_best_peer(figures.instance_ratios(rows, "first"))
    moved = figures.to_the_best_peer(figures.instance_ratios(rows, "commit"))
    few = (1000, 10_000)
    best = "the soonest of Embree's"
    yield from _worst(f"instances, first build / {best}", {n: first[n] for n in few if n in first}, 1.0)
    yield from _worst(f"instances, all moved / {best}", {n: moved[n] for n in few if n in moved}, 1.0)
    many = {n: ratio for n, ratio in first.items() if n >= 1_000_000}
    yield from _worst(f"a million instances, first build / {best}", many, 1.3)


def _of_refits(rows: Sequence[dict[str, Any]]) -> Iterator[Goal]:
    yield from _worst("refit, of Embree's time", figures.refit_shares(rows), 0.35, at_most=True)


def _of_python(rows: Sequence[dict[str, Any]]) -> Iterator[Goal]:
    for ours, peer in PAIRS.items():
        yield from _worst(f"Python, {ours} / {peer}", figures.python_ratios(rows, ours), 1.5)
    yield from _mean("Python, two threads / one", figures.thread_ratios(rows), 1.9)


GOALS = {
    "rays": _of_rays,
    "builds": _of_builds,
    "instances": _of_instances,
    "refits": _of_refits,
    "python": _of_python,
}
