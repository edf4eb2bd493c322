"""Which piece comes next: what is expected to take longest is not left to the end, where others would wait for it.

What a piece takes is known from those that were done: per frame, between the nearest of them before and after.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Collection, Sequence

from ...pieces.piece import Piece

NEAR_THE_END = 4  # pieces for each worker: before that, any order will do


class Costs:
    """What pieces took. is_in_order: whether they are to begin in the order of their frames."""

    def __init__(self, pieces: Sequence[Piece], is_in_order: bool) -> None:
        self._pieces = pieces
        self._is_in_order = is_in_order
        self._measured: list[tuple[int, float]] = []  # a piece's number, seconds per frame; rising

    def add(self, number: int, seconds: float) -> None:
        """A piece was done."""
        insort(self._measured, (number, seconds / len(self._pieces[number].frames)))

    def expected(self, number: int) -> float:
        """Seconds; as many as there are frames, as long as nothing is known."""
        return self._rate(number) * len(self._pieces[number].frames)

    def next_of(self, left: Collection[int], worker_count: int) -> int:
        """The number of the piece to do next, of those that are left, which is one at least."""
        if self._is_in_order or not self._measured or len(left) > NEAR_THE_END * worker_count:
            return min(left)
        return max(left, key=lambda number: (self.expected(number), -number))

    def _rate(self, number: int) -> float:
        if not self._measured:
            return 1.0
        at = bisect_left(self._measured, (number, 0.0))
        before, after = self._measured[max(at - 1, 0)], self._measured[min(at, len(self._measured) - 1)]
        if before[0] == after[0]:
            return before[1]
        share = min(max((number - before[0]) / (after[0] - before[0]), 0.0), 1.0)
        return before[1] + share * (after[1] - before[1])
