"""Where things of a chart over frames stand, in pixels: from frames and costs to places and back. Knows no Blender."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

Point = tuple[float, float]

# An axis of costs begins at zero if the least is below the first share of the most, where that is as good; and if it is
# above the second: differences that hardly matter shall not look large.
FROM_ZERO, ALIKE = 0.6, 0.95


@dataclass(frozen=True, slots=True)
class ChartLayout:
    """The part of a chart that curves are in.

    left, bottom, width, height: in pixels. first, last: the frames at its sides, low, high: the costs at its ends.
    """

    left: float
    bottom: float
    width: float
    height: float
    first: int
    last: int
    low: float
    high: float

    def place(self, frame: float, cost: float) -> Point:
        """Of a point of a curve."""
        return self.x_of(frame), self.bottom + (cost - self.low) / (self.high - self.low) * self.height

    def x_of(self, frame: float) -> float:
        """Of a frame; a single one stands in the middle."""
        span = self.last - self.first
        return self.left + self.width * ((frame - self.first) / span if span else 0.5)

    def frame_at(self, x: float, frames: Sequence[int]) -> int:
        """That of `frames` which is nearest to a place; there must be one."""
        span = self.last - self.first
        wanted = self.first + (x - self.left) / max(self.width, 1e-9) * span
        return min(frames, key=lambda frame: abs(frame - wanted))


def cost_range(costs: Sequence[float]) -> tuple[float, float]:
    """The ends of an axis that shows all of these, at round numbers."""
    if not costs:
        return 0.0, 1.0
    least, most = min(costs), max(costs)
    if not FROM_ZERO * most <= least <= ALIKE * most:
        least = 0.0
    step = round_step((most - least) / 4.0 or 1.0)
    return math.floor(least / step) * step, max(math.ceil(most / step), math.floor(least / step) + 1) * step


def round_step(size: float) -> float:
    """The least of 1, 2 and 5, times a power of ten, that is no less."""
    power = 10.0 ** math.floor(math.log10(size))
    return next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= size * (1.0 - 1e-9))


def cost_ticks(low: float, high: float) -> list[float]:
    """Round numbers from one end to the other, five or so."""
    step = round_step((high - low) / 5.0)
    first = math.ceil(low / step - 1e-9)
    return [step * number for number in range(first, math.floor(high / step + 1e-9) + 1)]


def frame_ticks(first: int, last: int, most: int) -> list[int]:
    """Frames to be named, the first among them, `most` at most."""
    step = max(1, round(round_step(max(1.0, (last - first) / max(most - 1, 1)))))
    return (
        sorted({first, *range(-(-first // step) * step, last + 1, step)}) if step > 1 else list(range(first, last + 1))
    )


def without_crowd(ticks: Sequence[int], layout: ChartLayout, room: float) -> list[int]:
    """Those that stand so many pixels apart, from the first on."""
    kept: list[int] = []
    for tick in ticks:
        if not kept or layout.x_of(tick) - layout.x_of(kept[-1]) >= room:
            kept.append(tick)
    return kept
