"""Describes a chart: panels of series, with units and spreads. `layout` decides how and where it is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

# Okabe and Ito's colours, distinguishable with any kind of colour blindness; and greys.
PALETTE = {
    "black": "#000000",
    "orange": "#E69F00",
    "sky": "#56B4E9",
    "green": "#009E73",
    "blue": "#0072B2",
    "vermilion": "#D55E00",
    "purple": "#CC79A7",
    "grey": "#707070",
    "pale": "#C8C8C8",
}

# Each engine has the same colour and mark in every chart.
OURS, EMBREE, BLENDER, CYCLES = "blue", "vermilion", "grey", "grey"

Mark = Literal["", "circle", "square", "triangle", "diamond", "ring"]
Labels = Literal["", "end", "first", "points"]


@dataclass(frozen=True, slots=True)
class Series:
    """Points that belong together. y may hold nan where nothing was measured.

    low, high: the spread about y, drawn as bars, or as a band where points are joined; x_low, x_high: the same about x.
    line: whether to join the points; dashed: how. labels: where its name is: behind the last point, next to the first,
    or `names` next to each of its points. size: of the marks, in pixels.
    """

    name: str
    x: Sequence[float]
    y: Sequence[float]
    color: str = OURS
    mark: Mark = "circle"
    low: Sequence[float] = ()
    high: Sequence[float] = ()
    x_low: Sequence[float] = ()
    x_high: Sequence[float] = ()
    line: bool = False
    dashed: bool = False
    width: float = 1.8
    size: float = 7.0
    labels: Labels = ""
    names: Sequence[str] = ()
    bold: bool = False


@dataclass(frozen=True, slots=True)
class Axis:
    """label: with the unit. has_zero: of a logarithmic axis: whether 0 has a separate place at its lower end.

    names: of a vertical axis: those of 0, 1, 2 ..., from the top.
    """

    label: str
    log: bool = False
    low: float | None = None
    high: float | None = None
    has_zero: bool = False
    powers: bool = False  # ticks as powers of ten rather than 1k, 1M
    names: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class Panel:
    """One pair of axes. notes: sentences inside, at (x, y) as shares of the panel from its lower left corner."""

    title: str
    x: Axis
    y: Axis
    series: Sequence[Series]
    notes: Sequence[tuple[float, float, str]] = ()


@dataclass(frozen=True, slots=True)
class Key:
    """A line of the legend, for series that are in all panels."""

    name: str
    color: str
    mark: Mark = "circle"
    line: bool = False
    dashed: bool = False


@dataclass(frozen=True, slots=True)
class Chart:
    """title: the chart's statement, in a sentence. subtitle: the measured quantities. footer: machine and command."""

    title: str
    subtitle: str
    panels: Sequence[Panel]
    footer: str = ""
    columns: int = 2
    panel_height: int = 250
    legend: Sequence[Key] = field(default=())
