"""Checking a random share of the answers, or of an image's rays, against a reference that knows no tree."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Batch, Progress, share_of

AUDITED_FIELDS = ("t_hit", "instance_ids", "primitive_ids")

_ROWS_AT_A_TIME = 1 << 14
_DEVIATIONS_AT_95_PERCENT = 1.959963984540054


@dataclass(frozen=True, slots=True)
class Audit:
    """What checking some of the answers again, in double precision and without a tree, has shown.

    checked_count: rays that were checked, drawn at random.
    wrong_rows (wrong,) int64: those whose answer is wrong, as rows of the flattened batch; of an image the pixels that
        they belong to, counted row by row from the top. Wrong: a miss although a
        triangle in range is surely hit; or a hit of a triangle that is surely missed, or whose t is off by more than
        rounding the ray to float can explain, or that lies behind a surely hit one. Of
        curves and points the same, by hulls whose balls are a little larger or smaller.
    ambiguous_count: rays that pass some triangle's edge, or an end of their range, so closely that rounding them to
        float decides: then either answer counts as right.
    """

    checked_count: int
    wrong_rows: npt.NDArray[np.int64]
    ambiguous_count: int

    @property
    def wrong_per_million(self) -> float:
        """Of the rays that were checked; 0 if none was."""
        return 1e6 * len(self.wrong_rows) / max(self.checked_count, 1)

    @property
    def interval(self) -> tuple[float, float]:
        """The wrong per million of all the batch's rays lie between these with a confidence of 95 % (Wilson 1927)."""
        count, wrong = self.checked_count, len(self.wrong_rows)
        if count == 0:
            return 0.0, 1e6
        square = _DEVIATIONS_AT_95_PERCENT**2
        centre = (wrong + square / 2) / (count + square)
        spread = math.sqrt(wrong * (count - wrong) / count + square / 4) * _DEVIATIONS_AT_95_PERCENT / (count + square)
        low = 0.0 if wrong == 0 else max(centre - spread, 0.0)
        high = 1.0 if wrong == count else min(centre + spread, 1.0)
        return 1e6 * low, 1e6 * high

    def __add__(self, other: Audit) -> Audit:
        """Of both together."""
        return Audit(
            self.checked_count + other.checked_count,
            np.concatenate([self.wrong_rows, other.wrong_rows]),
            self.ambiguous_count + other.ambiguous_count,
        )

    def __str__(self) -> str:
        low, high = self.interval
        return (
            f"{self.checked_count:,} rays checked, {len(self.wrong_rows):,} wrong, {self.ambiguous_count:,} ambiguous: "
            f"{self.wrong_per_million:,.0f} wrong per million ({low:,.0f} to {high:,.0f} at 95 %)"
        )


@dataclass(slots=True)
class RenderAudit:
    """Asks a render to check a share of its camera rays, and holds what that has shown: `render(..., audit=audit)`.

    share: 0 to 1. The rays are drawn at random, the same ones for the same seed, whatever the threads. Each costs about
    5 ns for every triangle of the scene. result: of all renders that were given this object, added up; seconds: what
    they have spent on it.
    """

    share: float = 1e-3
    result: Audit = field(default_factory=lambda: Audit(0, np.empty(0, np.int64), 0))
    seconds: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.share <= 1.0:
            raise ValueError(f"RenderAudit: share must be above 0 and at most 1, got {self.share!r}")

    def check(
        self, snapshot: _core.Snapshot, kept: dict[str, npt.NDArray[Any]], threads: int, progress: Progress | None
    ) -> None:
        """Adds what checking the rays shows that a render has kept, as columns of one row a ray."""
        started = time.perf_counter()
        count = len(kept["pixels"])
        wrong, ambiguous = np.empty(count, np.bool_), np.empty(count, np.bool_)
        for start in range(0, count, _ROWS_AT_A_TIME):
            part = slice(start, min(start + _ROWS_AT_A_TIME, count))
            snapshot.audit_answers(
                kept["origins"][part],
                kept["directions"][part],
                kept["t_min"][part],
                kept["t_max"][part],
                kept["masks"][part],
                kept["times"][part],
                "none",
                kept["t_hit"][part],
                kept["instance_ids"][part],
                kept["primitive_ids"][part],
                wrong[part],
                ambiguous[part],
                threads,
                share_of(progress, part.start / count, (part.stop - part.start) / count),
            )
        self.result += Audit(count, kept["pixels"][wrong], int(ambiguous.sum()))
        self.seconds += time.perf_counter() - started


def audit_answers(
    snapshot: _core.Snapshot,
    batch: Batch,
    cull: str,
    columns: dict[str, npt.NDArray[Any]],
    share: float,
    threads: int,
    progress: Progress | None,
) -> Audit:
    """Checks each ray of the batch with a chance of `share`; the same rays whenever the same snapshot is asked."""
    rows = _draw_rows(batch.count, share, seed=snapshot.generation)
    wrong, ambiguous = np.empty(len(rows), np.bool_), np.empty(len(rows), np.bool_)
    answers = [columns[name].reshape(-1) for name in AUDITED_FIELDS]
    for start in range(0, len(rows), _ROWS_AT_A_TIME):
        part = slice(start, min(start + _ROWS_AT_A_TIME, len(rows)))
        origins, directions, t_min, t_max, masks, times = batch.gather(rows[part])
        t_hit, instance_ids, primitive_ids = (answer[rows[part]] for answer in answers)
        snapshot.audit_answers(
            *(origins, directions, t_min, t_max, masks, times, cull),
            *(t_hit, instance_ids, primitive_ids, wrong[part], ambiguous[part], threads),
            share_of(progress, part.start / len(rows), (part.stop - part.start) / len(rows)),
        )
    return Audit(len(rows), rows[wrong], int(ambiguous.sum()))


def _draw_rows(count: int, share: float, seed: int) -> npt.NDArray[np.int64]:
    """Each of `count` rows with a chance of `share`, in order, at a cost that goes with how many are drawn."""
    generator = np.random.default_rng(seed)
    expected = count * share
    found, last = [], -1
    while last < count - 1:
        gaps = generator.geometric(share, size=int(expected + 4 * math.sqrt(expected)) + 16)
        rows = last + np.cumsum(np.minimum(gaps, count + 1))
        found.append(rows[rows < count])
        last = int(rows[-1])
    return np.concatenate(found) if found else np.empty(0, np.int64)
