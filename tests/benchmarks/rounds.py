"""Interleaved measurements: every competitor in turn, the order rotating, so that all suffer alike from the rest."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass

import numpy as np


@dataclass(frozen=True)
class Spread:
    """The median and the lower and upper quartile of some measurements."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, values: list[float]) -> Spread:
        low, median, high = np.quantile(values, [0.25, 0.5, 0.75], method="nearest")
        return cls(float(median), float(low), float(high))

    def as_json(self) -> dict[str, float]:
        return asdict(self)


def thread_seconds() -> float:
    """For work on one thread: its own CPU time, independent of other processes."""
    return time.thread_time()


def wall_seconds() -> float:
    """The wall clock, for work on several threads."""
    return time.perf_counter()


def run_rounds(
    competitors: Mapping[str, Callable[[], object]],
    rounds: int,
    clock: Callable[[], float] = thread_seconds,
    tell: Callable[[], object] = lambda: None,
    prepare: Callable[[str], object] = lambda name: None,
) -> dict[str, list[float]]:
    """Seconds of each round for each competitor. `prepare` is called before each call, `tell` after it, untimed."""
    names = list(competitors)
    seconds: dict[str, list[float]] = {name: [] for name in names}
    for number in range(rounds):
        for turn in range(len(names)):
            name = names[(turn + number) % len(names)]
            prepare(name)
            start = clock()
            competitors[name]()
            seconds[name].append(clock() - start)
            tell()
    return seconds
