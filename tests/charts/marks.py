"""The shapes of points and spreads."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from .picture import Disc, Line, Point, Shape

DASHES = (5.0, 3.5)
CORNERS = {"square": (4, 45.0, 1.18), "diamond": (4, 0.0, 1.25), "triangle": (3, -90.0, 1.3)}


def mark_at(point: Point, mark: str, size: float, color: str) -> Iterator[Disc | Shape]:
    """The mark with a thin white rim, so that overlapping marks stay distinct."""
    radius = size / 2.0
    if mark in ("circle", "ring"):
        yield Disc(point, radius + 1.0, "#FFFFFF")
        yield Disc(point, radius, color)
        if mark == "ring":
            yield Disc(point, radius - 1.8, "#FFFFFF")
    elif mark:
        count, turn, factor = CORNERS[mark]
        for rim, fill in ((1.5, "#FFFFFF"), (0.0, color)):
            reach = radius * factor + rim
            angles = [math.radians(turn + 360.0 * i / count) for i in range(count)]
            yield Shape([(point[0] + reach * math.cos(a), point[1] + reach * math.sin(a)) for a in angles], fill)


def spread_bar(start: Point, end: Point, color: str) -> Iterator[Line]:
    """A thin bar; nothing where the spread is smaller than the mark."""
    if math.dist(start, end) > 2.0:
        yield Line([start, end], lighter(color), 1.6)


def lighter(color: str) -> str:
    """Half way to white."""
    return "#" + "".join(f"{(int(color[i : i + 2], 16) + 255) // 2:02X}" for i in (1, 3, 5))


def band(lower: Sequence[Point], upper: Sequence[Point], color: str) -> Iterator[Shape]:
    """Between two lines, part by part."""
    for i in range(len(lower) - 1):
        corners = [lower[i], lower[i + 1], upper[i + 1], upper[i]]
        if not any(math.isnan(x + y) for x, y in corners):
            yield Shape(corners, color, 0.18)
