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

from ..statistics.words import number

# What a user's scene advises: a plain sentence for each part that was measured.


Figures = dict[str, Any]
FIXED_POLICIES = ("refit", "rebuild")
ALL_POLICIES = (*FIXED_POLICIES, "governed")
# What the governor does to trees beyond refitting them.
RESTRUCTURED = ("rebuilt", "partly_rebuilt", "rotated")
NOTHING_MOVES = "Nothing moves in these frames: trees are built once and kept."
NOTICEABLE = 1.05  # a difference below that is not worth a change
FEWEST_ROUNDS = 3  # that tell a difference from the machine's whims
TOO_LITTLE = "Too few rounds to tell builders apart: let it run longer."


def advice(figures: Figures) -> dict[str, str]:
    """By the part's name; one for each part that was measured."""
    makers: dict[str, tuple[str, Callable[[Figures], str]]] = {
        "builders": ("builders", _builder_advice),
        "total_time": ("builders", _time_advice),
        "answers": ("answers", _answer_advice),
        "frames": ("frames", _frame_advice),
        "decay": ("frames", _decay_advice),
    }
    found = {name: make for name, (part, make) in makers.items() if figures.get(part)}
    if not any(row["name"] == "auto" for row in figures.get("builders", ())):  # what others are compared with
        found = {name: make for name, make in found.items() if makers[name][0] != "builders"}
    return {name: make(figures) for name, make in found.items()}


def rays_per_second(figures: Figures, row: Figures, which: str = "typical") -> float:
    """In millions. which: of the times: "typical", or their quartiles "low" and "high"."""
    return float(figures["rays"] / row["trace_ms"][which] / 1e3)


def total_ms(figures: Figures, row: Figures, rays: float, which: str = "typical") -> float:
    """Milliseconds of a builder's trees and of so many rays through them."""
    return float(row["build_ms"][which] + rays / figures["rays"] * row["trace_ms"][which])


def frame_ms(row: Figures, policy: str) -> float:
    """Milliseconds of a frame's update and of the rays after it."""
    return float(row["policies"][policy]["update_ms"] + row["policies"][policy]["trace_ms"])


def frame_visits(row: Figures, policy: str) -> float:
    """Nodes and primitives that a ray visits in a frame's trees, in the mean."""
    return float(row["policies"][policy]["visits"])


def _builder_advice(figures: Figures) -> str:
    rows = figures["builders"]
    speeds = {row["name"]: rays_per_second(figures, row) for row in rows}
    trace, ready = ({row["name"]: row[key] for row in rows} for key in ("trace_ms", "build_ms"))
    best = max(speeds, key=lambda name: speeds[name])
    if min(row["trace_ms"]["count"] for row in rows) < FEWEST_ROUNDS:
        return TOO_LITTLE
    # Two builders differ only where the slow rounds of the one are still faster than the fast ones of the other.
    if speeds[best] < NOTICEABLE * speeds["auto"] or trace[best]["high"] > trace["auto"]["low"]:
        return "Leave the builder to the engine: no other makes this scene's rays reliably faster."
    faster, dearer = speeds[best] / speeds["auto"], ready[best]["typical"] / ready["auto"]["typical"]
    return f"BuildConfig(builder={best!r}) makes rays {faster:.2f} times as fast, for {dearer:.1f} times the build."


def _time_advice(figures: Figures) -> str:
    rows = {row["name"]: row for row in figures["builders"]}
    if min(row["trace_ms"]["count"] for row in rows.values()) < FEWEST_ROUNDS:
        return TOO_LITTLE
    few, many = (_reliably_best(figures, rows, rays) for rays in (1e5, 1e9))
    if few == many == "auto":
        return "Leave the builder to the engine, however many rays are cast: no other is noticeably less work."
    if few == many:
        return f"However many rays are cast, '{few}' trees are the least work here."
    step = 10.0**0.02
    rays = 1e5
    while rays < 1e9 and total_ms(figures, rows[many], rays) > total_ms(figures, rows[few], rays):
        rays *= step
    return (
        f"Up to about {_rays(rays)} rays '{few}' trees are the least work, '{many}' ones beyond: "
        "tell update(expected_rays=...) how many you cast."
    )


def _reliably_best(figures: Figures, rows: dict[str, Figures], rays: float) -> str:
    """The builder with the least work, unless what is chosen anyway does not take noticeably and reliably more."""
    best = min(rows, key=lambda name: total_ms(figures, rows[name], rays))
    is_noticeable = total_ms(figures, rows["auto"], rays) > NOTICEABLE * total_ms(figures, rows[best], rays)
    is_reliable = total_ms(figures, rows["auto"], rays, "low") > total_ms(figures, rows[best], rays, "high")
    return best if is_noticeable and is_reliable else "auto"


def _answer_advice(figures: Figures) -> str:
    answers = figures["answers"]
    if not answers["checked"] and answers["not_judged"]:
        return "No answer is checked: all rays come near curves or points, which are not judged."
    if not answers["checked"]:
        return "The scene is too large to check an answer without a tree in this time: give --seconds more."
    if answers["wrong"]:
        return f"{answers['wrong']} of {answers['checked']:,} checked answers are wrong: please report this scene."
    return (
        f"None of {answers['checked']:,} answers checked again is wrong: fewer than "
        f"{answers['interval'][1]:,.0f} per million are, at 95 % confidence."
    )


def _frame_advice(figures: Figures) -> str:
    rows = figures["frames"]
    sums = {policy: sum(frame_ms(row, policy) for row in rows) for policy in ALL_POLICIES}
    better = min(FIXED_POLICIES, key=lambda policy: sums[policy])
    ratio = sums["governed"] / sums[better]
    if not _moves(rows):
        return NOTHING_MOVES
    if ratio <= NOTICEABLE:
        return "Leave the policy to the governor: over these frames no fixed one is noticeably less work."
    share = 100.0 * (ratio - 1.0)
    return f"To {better} always would be {share:.0f} % less work over these frames than the governor."


def _decay_advice(figures: Figures) -> str:
    """What rays cost in the last frame, where trees were worst, and what the governor did about it."""
    rows = figures["frames"]
    if not _moves(rows):
        return NOTHING_MOVES
    refit, rebuild, governed = (number(frame_visits(rows[-1], policy), 3) for policy in ALL_POLICIES)
    shares = [frame_visits(row, "refit") / frame_visits(row, "rebuild") for row in rows]
    worst = max(range(len(rows)), key=lambda place: shares[place])
    if shares[worst] < NOTICEABLE:
        decay = "Refitted trees stay as good as new ones."
    else:
        decay = (
            f"Refitted trees are worst in frame {rows[worst]['frame']}: {shares[worst]:.2f} times what new ones cost."
        )
    frames = [row["frame"] for row in rows[1:] if set(RESTRUCTURED) & set(row["policies"]["governed"]["actions"])]
    if frames:
        done = (
            f"The governor improved or rebuilt trees in {len(frames)} of {len(rows) - 1} frames, first in {frames[0]}."
        )
    else:
        done = "The governor rebuilt no tree."
    return (
        f"In frame {rows[-1]['frame']} a ray visits {refit} nodes and primitives in trees that are only refitted, "
        f"{governed} in governed ones, {rebuild} in new ones. {decay} {done}"
    )


def _moves(rows: list[Figures]) -> bool:
    governed = [row["policies"]["governed"] for row in rows[1:]]
    return any(row["actions"] or row["moved"] for row in governed)


def _rays(count: float) -> str:
    """To two digits."""
    unit = 10.0 ** math.floor(math.log10(count) - 1.0)
    rounded = round(count / unit) * unit
    return f"{rounded / 1e6:,.3g} million" if rounded >= 1e6 else f"{rounded:,.0f}"


# Charts --------------------------------------------------------------------------------------------------------------


INCHES, DOTS = (8.0, 4.4), 200  # of one chart, and of an inch
INK, DIM, GRID = "#1A1A1A", "#555555", "#E6E6E6"
# Okabe and Ito's colours, which people with any kind of colour blindness can tell apart.
COLORS = {"fast": "#56B4E9", "auto": "#0072B2", "sweep": "#CC79A7", "spatial": "#009E73"}
POLICY_COLORS = {"refit": "#E69F00", "rebuild": "#D55E00", "governed": "#0072B2"}
ACTIONS = dict(zip(RESTRUCTURED, "sD^", strict=True))
BUILT_AS = {"binned": "auto"}  # what the planner calls the builder that "auto" names
MOST = 3.0  # times the least total time, that is shown


def draw(figures: Figures, titles: Mapping[str, str]) -> dict[str, Figure]:
    """A figure for each part that was measured and that has a chart, by its name. titles: of the parts, by name."""
    drawn = {}
    for name in _named(titles):
        drawn[name] = Figure(INCHES, dpi=DOTS, layout="constrained")
        _chart(drawn[name], figures, name, titles[name])
    return drawn


def draw_overview(figures: Figures, titles: Mapping[str, str]) -> Figure:
    """All of them, one above another."""
    names = _named(titles)
    whole = Figure((INCHES[0], INCHES[1] * len(names)), dpi=DOTS, layout="constrained")
    for name, part in zip(names, whole.subfigures(len(names), 1, squeeze=False)[:, 0], strict=True):
        _chart(part, figures, name, titles[name])
    return whole


def save(figure: Figure, path: Path) -> None:
    """As a PNG that says nothing of who made it when."""
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
        label = "what most triangles get when the number is told"
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
    axes.set(xlabel="rays cast", ylabel="build + rays, times the least", ylim=(0.9, MOST), xlim=(counts[0], counts[-1]))
    _say_plainly(axes.xaxis)
    _name_ends(axes, ends)


def _frames(axes: Axes, figures: Figures) -> None:
    _by_frame(axes, figures["frames"], frame_ms, "milliseconds: update and a million rays")


def _decay(axes: Axes, figures: Figures) -> None:
    _by_frame(axes, figures["frames"], frame_visits, "nodes and primitives that a ray visits")


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
    "total_time": (_total_time, "1 is the least time for so many rays."),
    "frames": (_frames, "In the first frame all trees are built."),
    "decay": (_decay, "What trees cost that are only refitted, rebuilt or governed; counted, not timed."),
}


def _most_triangles(choice: Figures) -> tuple[float, str]:
    """The number of rays, and the builder that the planner takes for most of the scene then."""
    return float(choice["rays"]), max(choice["triangles"], key=lambda name: choice["triangles"][name])


def _say_plainly(axis: Axis) -> None:
    """Of a logarithmic axis: ticks as 20, 1k or 5M, and enough of them where it spans little."""
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
    axes.get_ylim()  # settles what the places below depend on
    to_axes = axes.transData - axes.transAxes
    places = {name: min(to_axes.transform((axes.get_xlim()[1], y))[1], 1.0) for name, (y, _) in ends.items()}
    height = -math.inf
    for name in sorted(places, key=lambda name: places[name]):
        height = max(places[name], height + 0.055)
        axes.annotate(
            name, (1.0, height), (5, 0), "axes fraction", "offset points", color=ends[name][1], fontsize=9, va="center"
        )
