"""Where names go, so that they cover neither one another nor the points."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from .picture import Point


@dataclass(frozen=True, slots=True)
class Box:
    """In pixels, y downwards."""

    left: float
    top: float
    right: float
    bottom: float

    def overlap(self, other: Box) -> float:
        """Area in common."""
        width = min(self.right, other.right) - max(self.left, other.left)
        height = min(self.bottom, other.bottom) - max(self.top, other.top)
        return width * height if width > 0.0 and height > 0.0 else 0.0

    def outside(self, other: Box) -> float:
        """Area that is not in the other."""
        return (self.right - self.left) * (self.bottom - self.top) - self.overlap(other)


def around(point: Point, half: float) -> Box:
    """A square about a point."""
    return Box(point[0] - half, point[1] - half, point[0] + half, point[1] + half)


def place_beside(
    anchors: Sequence[Point], sizes: Sequence[Point], obstacles: Iterable[Box], bounds: Box, gap: float = 6.0
) -> list[Box]:
    """A box of each size next to its anchor, one after the other, where it covers least. sizes: (width, height)."""
    taken = list(obstacles)
    boxes = []
    for anchor, size in zip(anchors, sizes, strict=True):
        options = list(_beside(anchor, size, gap))
        costs = [
            sum(option.overlap(other) for other in taken) + 3.0 * option.outside(bounds) + 2.0 * rank
            for rank, option in enumerate(options)
        ]
        best = options[costs.index(min(costs))]
        taken.append(best)
        boxes.append(best)
    return boxes


def _beside(anchor: Point, size: Point, gap: float) -> Iterable[Box]:
    """The places to try, the most wanted first."""
    x, y = anchor
    width, height = size
    for far in (1.0, 1.9, 3.2):
        off, up = gap * far, (gap * far + height / 2.0)
        for dx, dy in ((off, 0.0), (-off - width, 0.0), (-width / 2, -up), (-width / 2, up)):
            yield _box(x + dx, y + dy, width, height)
        for dx in (off * 0.6, -off * 0.6 - width):
            for dy in (-up * 0.8, up * 0.8):
                yield _box(x + dx, y + dy, width, height)


def _box(left: float, middle: float, width: float, height: float) -> Box:
    return Box(left, middle - height / 2.0, left + width, middle + height / 2.0)


def spread_out(heights: Sequence[float], distance: float, top: float, bottom: float) -> list[float]:
    """Positions near the heights, in their order, at least `distance` apart, between top and bottom if they fit."""
    order = sorted(range(len(heights)), key=lambda i: heights[i])
    placed = [heights[i] for i in order]
    for _ in range(200):
        moved = False
        for i in range(len(placed) - 1):
            short = distance - (placed[i + 1] - placed[i])
            if short > 1e-3:
                placed[i] -= short / 2.0
                placed[i + 1] += short / 2.0
                moved = True
        if placed:
            placed[0], placed[-1] = max(placed[0], top), min(placed[-1], bottom)
        if not moved:
            break
    result = [0.0] * len(heights)
    for place, i in zip(placed, order, strict=True):
        result[i] = place
    return result
