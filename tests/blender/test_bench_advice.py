"""The bench's advice: it never rests on differences that a few rounds on a busy machine could produce."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("bpy")

from perfect_bvh_addon.bench.advice import TOO_LITTLE, advice

RAYS = 100_000


def times(typical: float, spread: float, rounds: int) -> dict[str, float]:
    return {"typical": typical, "low": typical * (1.0 - spread), "high": typical * (1.0 + spread), "count": rounds}


def advised(fast_build: float, fast_trace: float, *, spread: float = 0.01, rounds: int = 9) -> dict[str, str]:
    """Give advice for a scene. Usual trees take 100 ms to build and 10 ms for the bench's rays; others take these."""
    rows = [
        {"name": name, "build_ms": times(build, spread, rounds), "trace_ms": times(trace, spread, rounds)}
        for name, build, trace in (("auto", 100.0, 10.0), ("fast", fast_build, fast_trace))
    ]
    machine = {"processor": "any", "threads": 2, "isa": "scalar", "perfect_bvh": "0"}
    figures: dict[str, Any] = {"scene": "Scene", "rays": RAYS, "builders": rows, "machine": machine}
    return advice(figures | {"triangles": 12, "meshes": 1, "instances": 1})


def test_what_is_reliably_less_work_is_advised() -> None:
    sentence = advised(20.0, 12.0)["total_time"]
    assert sentence.startswith("Fast takes the least time in all up to about 4.2 million rays, Automatic beyond")
    assert advised(100.0, 5.0)["builders"].startswith("Fast makes rays 2.00 times as fast")


@pytest.mark.parametrize("others", [(80.0, 9.0), (20.0, 10.5), (100.0, 9.0)])
def test_differences_within_the_noise_advise_nothing(others: tuple[float, float]) -> None:
    for sentence in advised(*others, spread=0.9).values():
        assert sentence.startswith("Keep the builder Automatic")


def test_a_bench_that_was_stopped_early_advises_nothing() -> None:
    assert set(advised(20.0, 12.0, rounds=2).values()) == {TOO_LITTLE}
    assert TOO_LITTLE not in advised(20.0, 12.0, rounds=3).values()
