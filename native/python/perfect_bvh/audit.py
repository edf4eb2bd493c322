"""Checks a random share of the answers of triangles, or of an image's rays, without any tree."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Batch, Progress, share_of
from ._checks import check_number

AUDITED_FIELDS = ("t_hit", "instance_ids", "primitive_ids")

_ROWS_AT_A_TIME = 1 << 14
_WRONG, _AMBIGUOUS, _NOT_JUDGED = 1, 2, 4  # bits of the native module's verdicts
_DEVIATIONS_AT_95_PERCENT = 1.959963984540054


@dataclass(frozen=True, slots=True)
class Audit:
    """The result of checking some of the answers again, in double precision and without a tree.

    Attributes:
        checked_count: Rays that were judged, of those drawn at random.
        wrong_rows: (wrong,) int64: the rows of wrong answers in the flattened batch; for an image the pixels
            that they belong to, counted row by row from the top. An answer is wrong if it is a miss although a triangle
            in range is surely hit; or if its triangle is surely missed, has a t that is off by more than rounding the
            ray to float can explain, or lies behind a surely hit one.
        ambiguous_count: Rays that pass some triangle's edge, or an end of their range, so closely that rounding them to
            float decides: then either answer counts as right.
        not_judged_count: Rays that come near curves or points, which only tests judge; no triangle shows them wrong.
    """

    checked_count: int
    wrong_rows: npt.NDArray[np.int64]
    ambiguous_count: int
    not_judged_count: int = 0

    @classmethod
    def of(cls, verdicts: npt.NDArray[np.uint8], rows: npt.NDArray[np.int64]) -> Audit:
        """Sums up the native module's verdicts on rays; rows: the rows or pixels that they belong to."""
        wrong, ambiguous, not_judged = (verdicts & bit != 0 for bit in (_WRONG, _AMBIGUOUS, _NOT_JUDGED))
        left = int(not_judged.sum())
        return cls(len(verdicts) - left, rows[wrong], int(ambiguous.sum()), left)

    @property
    def wrong_per_million(self) -> float:
        """Wrong rays per million judged rays; 0 if none was judged."""
        return 1e6 * len(self.wrong_rows) / max(self.checked_count, 1)

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % confidence interval of the wrong per million of all the batch's rays (Wilson 1927)."""
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
        """Returns the sum of two audits."""
        return Audit(
            self.checked_count + other.checked_count,
            np.concatenate([self.wrong_rows, other.wrong_rows]),
            self.ambiguous_count + other.ambiguous_count,
            self.not_judged_count + other.not_judged_count,
        )

    def __str__(self) -> str:
        low, high = self.interval
        counts = (
            f"{self.checked_count:,} rays checked, {len(self.wrong_rows):,} wrong, {self.ambiguous_count:,} ambiguous"
        )
        if self.not_judged_count:
            counts += f", {self.not_judged_count:,} near curves or points not judged"
        return f"{counts}: {self.wrong_per_million:,.0f} wrong per million ({low:,.0f} to {high:,.0f} at 95 %)"


@dataclass(slots=True)
class RenderAudit:
    """Asks a render to check a share of its camera rays, and holds the result: `render(..., audit=audit)`.

    Attributes:
        share: 0 to 1. The rays are drawn at random, the same ones for the same seed, on any number of threads. Each
            costs about 5 ns for every triangle of the scene.
        result: The sum over all renders that were given this object
        seconds: The time spent on the checks.
    """

    share: float = 1e-3
    result: Audit = field(default_factory=lambda: Audit(0, np.empty(0, np.int64), 0))
    seconds: float = 0.0

    def __post_init__(self) -> None:
        check_number("RenderAudit", "share", self.share, 0.0, 1.0, above=True)

    def check(
        self, snapshot: _core.Snapshot, kept: dict[str, npt.NDArray[Any]], threads: int, progress: Progress | None
    ) -> None:
        """Checks the rays that a render has kept, as columns with one row for each ray, and adds the result."""
        started = time.perf_counter()
        names = ("origins", "directions", "t_min", "t_max", "masks", "times", *AUDITED_FIELDS)
        columns = [kept[name] for name in names]
        count = len(kept["pixels"])
        verdicts = _judge(snapshot, count, lambda part: [col[part] for col in columns], "none", threads, progress)
        self.result += Audit.of(verdicts, kept["pixels"])
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
    """Checks each ray of the batch with a probability of `share`; the same rays for the same snapshot."""
    rows = _draw_rows(batch.count, share, seed=snapshot.generation)
    answers = [columns[name].reshape(-1) for name in AUDITED_FIELDS]

    def columns_of(part: slice) -> Sequence[Any]:
        chosen = rows[part]
        return (*batch.gather(chosen), *(answer[chosen] for answer in answers))

    verdicts = _judge(snapshot, len(rows), columns_of, cull, threads, progress)
    return Audit.of(verdicts, rows)


def _judge(
    snapshot: _core.Snapshot,
    count: int,
    columns_of: Callable[[slice], Sequence[Any]],
    cull: str,
    threads: int,
    progress: Progress | None,
) -> npt.NDArray[np.uint8]:
    verdicts = np.empty(count, np.uint8)
    for start in range(0, count, _ROWS_AT_A_TIME):
        part = slice(start, min(start + _ROWS_AT_A_TIME, count))
        share = share_of(progress, part.start / count, (part.stop - part.start) / count)
        *rays, t_hit, instance_ids, primitive_ids = columns_of(part)
        verdicts[part] = snapshot.audit_answers((*rays, cull), t_hit, instance_ids, primitive_ids, threads, share)
    return verdicts


def _draw_rows(count: int, share: float, seed: int) -> npt.NDArray[np.int64]:
    """Draws each of `count` rows with a probability of `share`, in order, at a cost in proportion to the drawn rows."""
    generator = np.random.default_rng(seed)
    expected = count * share
    found, last = [], -1
    while last < count - 1:
        gaps = generator.geometric(share, size=int(expected + 4 * math.sqrt(expected)) + 16)
        rows = last + np.cumsum(np.minimum(gaps, count + 1))
        found.append(rows[rows < count])
        last = int(rows[-1])
    return np.concatenate(found) if found else np.empty(0, np.int64)
