"""Lays out a chart as a picture: places every panel, axis, mark and word. In pixels, 800 across the README."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from .chart import PALETTE, Chart, Panel, Series
from .labels import Box, around, place_beside, spread_out
from .marks import DASHES, band, mark_at, spread_bar
from .picture import Line, Picture, Point, Shape, Text, width_of, wrap
from .scales import Scale

WIDTH = 800
MARGIN = 14.0
TITLE, SUBTITLE, HEAD, LABEL, TICK, FOOTER = 17.0, 12.5, 13.0, 12.0, 11.5, 10.0
INK, DIM, GRID, FRAME = "#1A1A1A", "#555555", "#E6E6E6", "#9A9A9A"
GAP = 26.0  # between panels


def lay_out(chart: Chart) -> Picture:
    """The picture of a chart, as high as it needs to be."""
    picture = Picture(WIDTH, 0)
    top = _write_heads(picture, chart)
    columns = min(chart.columns, len(chart.panels))
    width = (WIDTH - 2 * MARGIN - GAP * (columns - 1)) / columns
    for number, panel in enumerate(chart.panels):
        row, column = divmod(number, columns)
        left = MARGIN + column * (width + GAP)
        place = Box(left, top + row * chart.panel_height, left + width, top + (row + 1) * chart.panel_height)
        _PanelLayout(picture, panel, place).draw()
    bottom = top + math.ceil(len(chart.panels) / columns) * chart.panel_height
    for line in wrap(chart.footer, FOOTER, WIDTH - 2 * MARGIN):
        bottom += FOOTER * 1.35
        picture.texts.append(Text((MARGIN, bottom), line, FOOTER, DIM))
    picture.height = math.ceil(bottom + MARGIN * 0.7)
    picture.marks.insert(0, Shape(_corners(Box(0, 0, WIDTH, picture.height)), "#FFFFFF"))
    return picture


def _write_heads(picture: Picture, chart: Chart) -> float:
    """Title, subtitle and legend; where the panels begin."""
    y = MARGIN * 0.6
    for line in wrap(chart.title, TITLE * 1.08, WIDTH - 2 * MARGIN):
        y += TITLE * 1.25
        picture.texts.append(Text((MARGIN, y), line, TITLE, INK, bold=True))
    y += 2.0
    for line in wrap(chart.subtitle, SUBTITLE, WIDTH - 2 * MARGIN):
        y += SUBTITLE * 1.35
        picture.texts.append(Text((MARGIN, y), line, SUBTITLE, DIM))
    if chart.legend:
        y = _write_legend(picture, chart, y + LABEL * 1.75)
    return y + 10.0


def _write_legend(picture: Picture, chart: Chart, y: float) -> float:
    x = MARGIN
    for key in chart.legend:
        room = 24.0 if key.line else 14.0
        width = room + width_of(key.name, LABEL) + 18.0
        if x > MARGIN and x + width > WIDTH - MARGIN:
            x, y = MARGIN, y + LABEL * 1.5
        color, middle = PALETTE[key.color], (x + room / 2.0 - 2.0, y - LABEL * 0.36)
        if key.line:
            ends = [(x, middle[1]), (x + room - 4.0, middle[1])]
            picture.marks.append(Line(ends, color, 2.0, DASHES if key.dashed else None))
        picture.marks += mark_at(middle, key.mark, 7.0, color)
        picture.texts.append(Text((x + room + 2.0, y), key.name, LABEL, INK))
        x += width
    return y


@dataclass(slots=True)
class _Name:
    """A name to place next to a point."""

    at: Point
    words: str
    color: str
    bold: bool


class _PanelLayout:
    """One panel of a chart."""

    def __init__(self, picture: Picture, panel: Panel, place: Box) -> None:
        self._picture, self._panel = picture, panel
        self._x = Scale.over(panel.x, _values(panel, "x", "x_low", "x_high"))
        self._y = Scale.over(panel.y, _values(panel, "y", "low", "high"))
        head = HEAD * 1.3 if panel.title else 0.0
        ends = [width_of(s.name, LABEL, bold=s.bold) + 12.0 for s in panel.series if s.labels == "end"]
        self._area = Box(
            place.left + max([44.0, *(width_of(name, TICK) + 10.0 for name in panel.y.names)]),
            place.top + head + LABEL * 1.7,
            place.right - max([10.0, *ends]),
            place.bottom - TICK * 1.4 - LABEL * 2.2,
        )
        self._place = place

    def draw(self) -> None:
        self._frame()
        names: list[_Name] = []
        obstacles: list[Box] = []
        for series in self._panel.series:
            self._spread(series)
        for series in self._panel.series:
            points = [point for point in self._points(series) if not math.isnan(point[0] + point[1])]
            self._series(series, points)
            obstacles += [around(point, series.size * 0.6) for point in points if series.mark]
            obstacles += [around(point, 3.0) for point in _along(points) if series.line]
            names += list(self._names(series, points))
        sizes = [(width_of(name.words, LABEL, bold=name.bold), LABEL * 1.1) for name in names]
        boxes = place_beside([name.at for name in names], sizes, obstacles, self._area)
        for name, box in zip(names, boxes, strict=True):
            self._write((box.left, box.bottom - LABEL * 0.26), name.words, LABEL, name.color, bold=name.bold)
        self._end_names()
        for x, y, words in self._panel.notes:
            at = (self._across(x), self._up(y))
            self._write(at, words, LABEL, DIM)

    # Frame ------------------------------------------------------------------------------------------------------

    def _frame(self) -> None:
        area, panel = self._area, self._panel
        if panel.title:
            self._write((self._place.left, self._place.top + HEAD), panel.title, HEAD, INK, bold=True)
        self._write((self._place.left, area.top - LABEL * 0.7), panel.y.label, LABEL, DIM)
        for value, words in self._y.ticks(area.bottom - area.top):
            y = self._up(self._y.place(value))
            self._picture.marks.append(Line([(area.left, y), (area.right, y)], GRID, 1.0))
            self._write((area.left - 6.0, y + TICK * 0.36), words, TICK, DIM, "right")
        last = -math.inf
        for value, words in self._x.ticks(area.right - area.left):
            x, half = self._across(self._x.place(value)), width_of(words, TICK) / 2.0
            self._picture.marks.append(Line([(x, area.top), (x, area.bottom)], GRID, 1.0))
            if x - half > last + 5.0:
                self._write((x, area.bottom + TICK * 1.35), words, TICK, DIM, "middle")
                last = x + half
        corner = [(area.left, area.top), (area.left, area.bottom), (area.right, area.bottom)]
        self._picture.marks.append(Line(corner, FRAME, 1.2))
        middle = (area.left + area.right) / 2.0
        self._write((middle, area.bottom + TICK * 1.4 + LABEL * 1.35), panel.x.label, LABEL, DIM, "middle")

    # Series -----------------------------------------------------------------------------------------------------

    def _spread(self, series: Series) -> None:
        """Under everything else."""
        color, marks = PALETTE[series.color], self._picture.marks
        if series.line and series.low:
            lower = list(self._points(series, y=series.low))
            upper = list(self._points(series, y=series.high))
            marks += band(lower, upper, color)
        elif series.low:
            for (x, _), low, high in zip(self._points(series), series.low, series.high, strict=True):
                ends = (self._up(self._y.place(low)), self._up(self._y.place(high)))
                marks += spread_bar((x, ends[0]), (x, ends[1]), color)
        if series.x_low:
            for (_, y), low, high in zip(self._points(series), series.x_low, series.x_high, strict=True):
                ends = (self._across(self._x.place(low)), self._across(self._x.place(high)))
                marks += spread_bar((ends[0], y), (ends[1], y), color)

    def _series(self, series: Series, points: list[Point]) -> None:
        color, marks = PALETTE[series.color], self._picture.marks
        if series.line and len(points) > 1:
            marks.append(Line(points, color, series.width, DASHES if series.dashed else None))
        for point in points:
            marks += mark_at(point, series.mark, series.size, color)

    def _names(self, series: Series, points: list[Point]) -> Iterator[_Name]:
        if series.labels == "points":
            for point, words in zip(points, series.names or [series.name] * len(points), strict=True):
                if words:
                    yield _Name(point, words, PALETTE[series.color], series.bold)
        elif series.labels == "first" and points:
            yield _Name(points[0], series.name, PALETTE[series.color], series.bold)

    def _end_names(self) -> None:
        """Behind the last points, in one column."""
        named = []
        for series in self._panel.series:
            points = [point for point in self._points(series) if not math.isnan(point[0] + point[1])]
            if series.labels == "end" and points:
                named.append((series, points[-1]))
        heights = spread_out([point[1] for _, point in named], LABEL * 1.2, self._area.top, self._area.bottom)
        for (series, point), y in zip(named, heights, strict=True):
            color, right = PALETTE[series.color], self._area.right
            if abs(y - point[1]) > 3.0 or right - point[0] > 12.0:
                self._picture.marks.append(Line([(point[0] + 3.0, point[1]), (right + 6.0, y)], color, 0.6))
            self._write((right + 8.0, y + LABEL * 0.34), series.name, LABEL, color, bold=series.bold)

    # Places -----------------------------------------------------------------------------------------------------

    def _points(self, series: Series, y: object = None) -> Iterator[Point]:
        for x, value in zip(series.x, series.y if y is None else y, strict=True):  # type: ignore[call-overload]
            yield self._across(self._x.place(x)), self._up(self._y.place(value))

    def _across(self, share: float) -> float:
        return self._area.left + share * (self._area.right - self._area.left)

    def _up(self, share: float) -> float:
        return self._area.bottom - share * (self._area.bottom - self._area.top)

    def _write(self, at: Point, words: str, size: float, color: str, anchor: str = "left", bold: bool = False) -> None:
        self._picture.texts.append(Text(at, words, size, color, anchor, bold))  # type: ignore[arg-type]


def _values(panel: Panel, *names: str) -> Iterator[float]:
    for series in panel.series:
        for name in names:
            yield from (float(value) for value in getattr(series, name))


def _along(points: list[Point], step: float = 8.0) -> Iterator[Point]:
    """Places on the line through the points, that names should not cover."""
    for (x0, y0), (x1, y1) in pairwise(points):
        count = max(1, int(math.hypot(x1 - x0, y1 - y0) / step))
        for i in range(count + 1):
            yield x0 + (x1 - x0) * i / count, y0 + (y1 - y0) * i / count


def _corners(box: Box) -> list[Point]:
    return [(box.left, box.top), (box.right, box.top), (box.right, box.bottom), (box.left, box.bottom)]
