"""The measurements of a user's scene as charts, drawn by matplotlib, without its global state.

A chart's title is the advice that its figures give. Needs matplotlib, which is imported nowhere else in the add-on.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, FigureBase
from matplotlib.ticker import EngFormatter, LogLocator, NullLocator

from .advice import RESTRUCTURED, Figures, frame_ms, frame_visits, rays_per_second, total_ms

INCHES, DOTS = (8.0, 4.4), 200  # of one chart, and of an inch
INK, DIM, GRID = "#1A1A1A", "#555555", "#E6E6E6"
# Okabe and Ito's colours, which people with any kind of colour blindness can distinguish.
COLORS = {"fast": "#56B4E9", "auto": "#0072B2", "sweep": "#CC79A7", "spatial": "#009E73"}
POLICY_COLORS = {"refit": "#E69F00", "rebuild": "#D55E00", "governed": "#0072B2"}
ACTIONS = dict(zip(RESTRUCTURED, "sD^", strict=True))
BUILT_AS = {"binned": "auto"}  # the planner's names of builders, and the settings that choose them
MOST = 3.0  # times the least total time, that is shown


def draw(figures: Figures, titles: Mapping[str, str]) -> dict[str, Figure]:
    """A figure for each part that was measured and that has a chart, by its name. titles: of the parts, by name."""
    drawn = {}
    for name in _named(titles):
        drawn[name] = Figure(INCHES, dpi=DOTS, layout="constrained")
        _chart(drawn[name], figures, name, titles[name])
    return drawn


def draw_overview(figures: Figures, titles: Mapping[str, str]) -> Figure:
    """Draws all charts, one above another."""
    names = _named(titles)
    whole = Figure((INCHES[0], INCHES[1] * len(names)), dpi=DOTS, layout="constrained")
    for name, part in zip(names, whole.subfigures(len(names), 1, squeeze=False)[:, 0], strict=True):
        _chart(part, figures, name, titles[name])
    return whole


def save(figure: Figure, path: Path) -> None:
    """Saves a PNG without metadata about its author or date."""
    FigureCanvasAgg(figure).print_png(str(path), metadata={"Software": None})


def _named(titles: Mapping[str, str]) -> list[str]:
    return [name for name in PARTS if name in titles]


def _chart(figure: FigureBase, figures: Figures, name: str, title: str) -> None:
    draw_part, how = PARTS[name]
    axes = figure.subplots()
    axes.grid(color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(which="both", colors=DIM, labelsize=8)
    draw_part(axes, figures)
    axes.xaxis.label.set(color=DIM, fontsize=9)
    axes.yaxis.label.set(color=DIM, fontsize=9)
    counts = f"{figures['triangles']:,} triangles in {figures['meshes']:,} meshes, {figures['instances']:,} instances"
    axes.set_title(f"{figures['scene']}: {counts}. {how}", loc="left", color=DIM, fontsize=8)
    heading = textwrap.fill(title, 80)
    figure.suptitle(heading, x=0.01, ha="left", color=INK, fontsize=11, fontweight="bold")
    machine = figures["machine"]
    words = f"{machine['processor']}, {machine['threads']} threads, {machine['isa']}; perfect_bvh"
    figure.supxlabel(f"{words} {machine['perfect_bvh']}", x=0.01, ha="left", color=DIM, fontsize=7)


# Parts --------------------------------------------------------------------------------------------------------------


def _builders(axes: Axes, figures: Figures) -> None:
    for row in figures["builders"]:
        x, color = row["build_ms"]["typical"], COLORS[row["name"]]
        _point(axes, figures, row, x, color, [[x - row["build_ms"]["low"]], [row["build_ms"]["high"] - x]])
    axes.set_xscale("log")
    axes.set(xlabel="milliseconds to build all trees", ylabel="million bounced rays a second")
    axes.margins(0.15)
    _say_plainly(axes.xaxis)


def _total_time(axes: Axes, figures: Figures) -> None:
    rows = {row["name"]: row for row in figures["builders"]}
    counts = [10.0 ** (4.0 + i / 10.0) for i in range(61)]
    least = {rays: min(total_ms(figures, row, rays) for row in rows.values()) for rays in counts}
    ends = {}
    for name, row in rows.items():
        shares = [total_ms(figures, row, rays) / least[rays] for rays in counts]
        axes.plot(counts, shares, color=COLORS[name], linewidth=1.8)
        ends[name] = shares[-1], COLORS[name]
    told = [(rays, BUILT_AS.get(name, name)) for rays, name in map(_most_triangles, figures.get("planner", ()))]
    rings = [(rays, name) for rays, name in told if name in rows and rays in least]
    heights = [total_ms(figures, rows[name], rays) / least[rays] for rays, name in rings]
    if rings:
        label = "the builder of most triangles if the number of rays is known"
        ring = {
            "color": INK,
            "markerfacecolor": "white",
            "markersize": 6,
            "linestyle": "",
            "zorder": 3,
            "clip_on": False,
        }
        axes.plot([rays for rays, _ in rings], heights, "o", label=label, **ring)
        axes.legend(loc="upper right", frameon=False, fontsize=8, labelcolor=DIM)
    axes.set_xscale("log")
    axes.set(
        xlabel="rays cast", ylabel="build + rays, relative to the best", ylim=(0.9, MOST), xlim=(counts[0], counts[-1])
    )
    _say_plainly(axes.xaxis)
    _name_ends(axes, ends)


def _frames(axes: Axes, figures: Figures) -> None:
    _by_frame(axes, figures["frames"], frame_ms, "milliseconds: update and a million rays")


def _decay(axes: Axes, figures: Figures) -> None:
    _by_frame(axes, figures["frames"], frame_visits, "nodes and primitives visited per ray")


def _by_frame(axes: Axes, rows: list[Figures], cost: Callable[[Figures, str], float], words: str) -> None:
    """A curve for each policy, with marks where the governor did more than refit."""
    ends = {}
    for policy, color in POLICY_COLORS.items():
        costs = [cost(row, policy) for row in rows]
        axes.plot([row["frame"] for row in rows], costs, color=color, linewidth=1.8)
        ends[policy] = costs[-1], color
    for action, mark in ACTIONS.items():
        chosen = [row for row in rows[1:] if action in row["policies"]["governed"]["actions"]]
        if chosen:
            places = [row["frame"] for row in chosen], [cost(row, "governed") for row in chosen]
            axes.plot(*places, mark, color=INK, markersize=5, label=f"governed: {action.replace('_', ' ')}")
    if axes.get_legend_handles_labels()[1]:
        axes.legend(loc="best", frameon=False, fontsize=8, labelcolor=DIM)
    axes.set_yscale("log")
    axes.margins(x=0.0)
    axes.set(xlabel="frame", ylabel=words)
    axes.xaxis.get_major_locator().set_params(integer=True)
    _say_plainly(axes.yaxis)
    _name_ends(axes, ends)


BETTER = "Up and to the left is better. Bars: quartiles."
PARTS: dict[str, tuple[Callable[[Axes, Figures], None], str]] = {
    "builders": (_builders, BETTER),
    "total_time": (_total_time, "1 is the shortest time for this number of rays."),
    "frames": (_frames, "In the first frame all trees are built."),
    "decay": (_decay, "Costs of trees that are only refitted, always rebuilt, or governed: counted, not timed."),
}


def _most_triangles(choice: Figures) -> tuple[float, str]:
    """The number of rays, and the builder that the planner takes for most of the scene then."""
    return float(choice["rays"]), max(choice["triangles"], key=lambda name: choice["triangles"][name])


def _say_plainly(axis: Axis) -> None:
    """Formats the ticks of a logarithmic axis as 20, 1k or 5M, with enough of them on a short range."""
    low, high = axis.get_view_interval()
    decades = math.log10(high / low)
    steps = (1.0,) if decades > 2.5 else (1.0, 2.0, 5.0) if decades > 0.8 else (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_major_formatter(EngFormatter(sep=""))
    axis.set_minor_locator(NullLocator())


# Marks --------------------------------------------------------------------------------------------------------------


def _point(axes: Axes, figures: Figures, row: Figures, x: float, color: str, x_spread: Any = None) -> None:
    """The speed of rays, with its spread and the row's name."""
    y = rays_per_second(figures, row)
    spread = [[y - rays_per_second(figures, row, "high")], [rays_per_second(figures, row, "low") - y]]
    axes.errorbar(x, y, spread, x_spread, "o", color=color, markersize=7, elinewidth=1.4, capsize=2)
    axes.annotate(row["name"], (x, y), (7, 6), textcoords="offset points", color=color, fontsize=9)


def _name_ends(axes: Axes, ends: Mapping[str, tuple[float, str]]) -> None:
    """Behind the last points, one under another where these are too near."""
    axes.get_ylim()  # fixes the limits on which the positions below depend
    to_axes = axes.transData - axes.transAxes
    places = {name: min(to_axes.transform((axes.get_xlim()[1], y))[1], 1.0) for name, (y, _) in ends.items()}
    height = -math.inf
    for name in sorted(places, key=lambda name: places[name]):
        height = max(places[name], height + 0.055)
        axes.annotate(
            name, (1.0, height), (5, 0), "axes fraction", "offset points", color=ends[name][1], fontsize=9, va="center"
        )
