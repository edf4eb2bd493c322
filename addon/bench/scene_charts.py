"""A user's scene as charts, each with the sentence of advice that its figures give."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from .chart import Axis, Chart, Key, Panel, Series

Figures = dict[str, Any]
COLORS = {"fast": "sky", "auto": "blue", "sweep": "purple", "spatial": "green"}
POLICY_COLORS = {"refit": "orange", "rebuild": "vermilion", "governed": "blue"}
BUILT_AS = {"binned": "auto"}  # what the planner calls the builder that "auto" names
NOTICEABLE = 1.05  # a difference below that is not worth a change
FEWEST_ROUNDS = 3  # that tell a difference from the machine's whims
TOO_LITTLE = "Too few rounds to tell builders apart: let it run longer."


def make_charts(figures: Figures) -> dict[str, Chart]:
    """By name; one for each part that was measured."""
    makers: dict[str, tuple[str, Callable[[Figures], Chart]]] = {
        "builders": ("builders", _builders),
        "total_time": ("builders", _total_time),
        "layouts": ("layouts", _layouts),
        "answers": ("answers", _answers),
        "frames": ("frames", _frames),
    }
    found = {name: make for name, (part, make) in makers.items() if figures.get(part)}
    if not any(row["name"] == "auto" for row in figures.get("builders", ())):  # what others are compared with
        found = {name: make for name, make in found.items() if makers[name][0] != "builders"}
    return {name: make(figures) for name, make in found.items()}


def advice(figures: Figures) -> dict[str, str]:
    """One plain sentence for each chart: its title."""
    return {name: chart.title for name, chart in make_charts(figures).items()}


def _builders(figures: Figures) -> Chart:
    rows = figures["builders"]
    speeds = {row["name"]: figures["rays"] / row["trace_ms"]["typical"] / 1e3 for row in rows}
    trace, ready = ({row["name"]: row[key] for row in rows} for key in ("trace_ms", "build_ms"))
    best = max(speeds, key=lambda name: speeds[name])
    # Two builders differ only where the slow rounds of the one are still faster than the fast ones of the other.
    if min(row["trace_ms"]["count"] for row in rows) < FEWEST_ROUNDS:
        title = TOO_LITTLE
    elif speeds[best] < NOTICEABLE * speeds["auto"] or trace[best]["high"] > trace["auto"]["low"]:
        title = "Leave the builder to the engine: no other makes this scene's rays reliably faster."
    else:
        faster, dearer = speeds[best] / speeds["auto"], ready[best]["typical"] / ready["auto"]["typical"]
        title = (
            f"BuildConfig(builder={best!r}) makes rays {faster:.2f} times as fast, for {dearer:.1f} times the build."
        )
    series = [
        Series(
            row["name"],
            [row["build_ms"]["typical"]],
            [speeds[row["name"]]],
            COLORS[row["name"]],
            low=[figures["rays"] / row["trace_ms"]["high"] / 1e3],
            high=[figures["rays"] / row["trace_ms"]["low"] / 1e3],
            x_low=[row["build_ms"]["low"]],
            x_high=[row["build_ms"]["high"]],
            size=9.0,
            labels="first",
        )
        for row in rows
    ]
    axes = (Axis("milliseconds to build all trees", log=True), Axis("million bounced rays a second"))
    return _chart(figures, title, "Up and to the left is better. Bars: quartiles.", Panel("", *axes, series))


def _total_time(figures: Figures) -> Chart:
    rows = {row["name"]: row for row in figures["builders"]}
    counts = [10.0 ** (4.0 + i / 10.0) for i in range(61)]
    best = {rays: min(_total(figures, row, rays) for row in rows.values()) for rays in counts}
    series = [
        Series(
            name,
            counts,
            [_within(_total(figures, row, rays) / best[rays]) for rays in counts],
            COLORS[name],
            "",
            line=True,
        )
        for name, row in rows.items()
    ]
    legend = [Key(name, COLORS[name], "", True) for name in rows]
    for choice in figures.get("planner", ()):
        name = max(choice["triangles"], key=lambda each: choice["triangles"][each])
        name = BUILT_AS.get(name, name)
        if name in rows:
            rays = float(choice["rays"])
            share = _total(figures, rows[name], rays) / min(_total(figures, row, rays) for row in rows.values())
            series.append(Series("planner", [rays], [_within(share)], "black", "ring", size=10.0))
    if figures.get("planner"):
        legend.append(Key("what most triangles get when the number is told", "black", "ring"))
    axes = (Axis("rays cast", log=True), Axis("build + rays, times the least", low=0.9, high=3.0))
    how = "1 is the least time for so many rays."
    return _chart(figures, _advise_on_counts(figures, rows), how, Panel("", *axes, series), tuple(legend))


def _advise_on_counts(figures: Figures, rows: dict[str, Figures]) -> str:
    if min(row["trace_ms"]["count"] for row in rows.values()) < FEWEST_ROUNDS:
        return TOO_LITTLE
    few, many = (_reliably_best(figures, rows, rays) for rays in (1e5, 1e9))
    if few == many == "auto":
        return "Leave the builder to the engine, however many rays are cast: no other is noticeably less work."
    if few == many:
        return f"However many rays are cast, '{few}' trees are the least work here."
    step = 10.0**0.02
    rays = 1e5
    while rays < 1e9 and _total(figures, rows[many], rays) > _total(figures, rows[few], rays):
        rays *= step
    return (
        f"Up to about {_rays(rays)} rays '{few}' trees are the least work, '{many}' ones beyond: "
        "tell update(expected_rays=...) how many you cast."
    )


def _reliably_best(figures: Figures, rows: dict[str, Figures], rays: float) -> str:
    """The builder with the least work, unless what is chosen anyway does not take noticeably and reliably more."""
    best = min(rows, key=lambda name: _total(figures, rows[name], rays))
    is_noticeable = _total(figures, rows["auto"], rays) > NOTICEABLE * _total(figures, rows[best], rays)
    is_reliable = _total(figures, rows["auto"], rays, "low") > _total(figures, rows[best], rays, "high")
    return best if is_noticeable and is_reliable else "auto"


def _layouts(figures: Figures) -> Chart:
    rows = {row["name"]: row for row in figures["layouts"]}
    saved = 1.0 - rows["compact"]["byte_count"] / rows["default"]["byte_count"]
    slower = rows["compact"]["trace_ms"]["typical"] / rows["default"]["trace_ms"]["typical"] - 1.0
    cost = f"make rays {100 * slower:.0f} % slower" if slower >= 0.01 else "make rays no slower"
    sizes = " become ".join(f"{rows[name]['byte_count'] / 2**20:,.1f} MiB" for name in ("default", "compact"))
    title = f"BuildConfig(layout='compact') would take {100 * saved:.0f} % less memory and {cost}: {sizes}."
    series = [
        Series(
            name,
            [row["byte_count"] / 2**20],
            [figures["rays"] / row["trace_ms"]["typical"] / 1e3],
            "blue",
            "circle" if name == "default" else "ring",
            low=[figures["rays"] / row["trace_ms"]["high"] / 1e3],
            high=[figures["rays"] / row["trace_ms"]["low"] / 1e3],
            size=10.0,
            labels="first",
        )
        for name, row in rows.items()
    ]
    axes = (Axis("MiB of geometry and trees"), Axis("million bounced rays a second"))
    return _chart(figures, title, "Up and to the left is better. Bars: quartiles.", Panel("", *axes, series))


def _answers(figures: Figures) -> Chart:
    answers = figures["answers"]
    if not answers["checked"]:
        title = "The scene is too large to check an answer without a tree in this time: give --seconds more."
    elif answers["wrong"]:
        title = f"{answers['wrong']} of {answers['checked']:,} checked answers are wrong: please report this scene."
    else:
        title = (
            f"None of {answers['checked']:,} answers checked again is wrong: fewer than "
            f"{answers['interval'][1]:,.0f} per million are, at 95 % confidence."
        )
    series = [
        Series(
            "answers",
            [figures["rays"] / answers["trace_ms"]["typical"] / 1e3],
            [answers["wrong_per_million"]],
            "blue",
            low=[answers["interval"][0]],
            high=[answers["interval"][1]],
            x_low=[figures["rays"] / answers["trace_ms"]["high"] / 1e3],
            x_high=[figures["rays"] / answers["trace_ms"]["low"] / 1e3],
            size=10.0,
        )
    ]
    y = Axis("wrong answers per million", log=True, has_zero=True, low=1.0, high=1e6, powers=True)
    how = "Down and to the right is better. Bars: where the share of wrong answers lies with 95 % confidence."
    return _chart(figures, title, how, Panel("", Axis("million bounced rays a second"), y, series))


def _frames(figures: Figures) -> Chart:
    rows = figures["frames"]
    numbers = [float(row["frame"]) for row in rows]
    sums = {policy: sum(_frame_ms(row, policy) for row in rows) for policy in POLICY_COLORS}
    better = min(("refit", "rebuild"), key=lambda policy: sums[policy])
    ratio = sums["governed"] / sums[better]
    if not any(row["policies"]["governed"]["actions"] or row["policies"]["governed"]["moved"] for row in rows[1:]):
        title = "Nothing moves in these frames: trees are built once and kept."
    elif ratio <= NOTICEABLE:
        title = "Leave the policy to the governor: over these frames no fixed one is noticeably less work."
    else:
        title = f"Scene(policy={better!r}) would be {_more(ratio)} less work over these frames than the governor."
    series = [
        Series(policy, numbers, [_frame_ms(row, policy) for row in rows], color, "", line=True, labels="end")
        for policy, color in POLICY_COLORS.items()
    ]
    marks = (("rebuilt", "square"), ("partly_rebuilt", "diamond"), ("rotated", "triangle"))
    legend = []
    for action, mark in marks:
        chosen = [row for row in rows[1:] if action in row["policies"]["governed"]["actions"]]
        if chosen:
            xs, ys = [float(row["frame"]) for row in chosen], [_frame_ms(row, "governed") for row in chosen]
            series.append(Series(action, xs, ys, "black", mark, size=8.0))  # type: ignore[arg-type]
            legend.append(Key(f"governed: {action.replace('_', ' ')}", "black", mark))  # type: ignore[arg-type]
    axes = (Axis("frame"), Axis("milliseconds: update and a million rays"))
    how = "In the first frame all trees are built."
    return _chart(figures, title, how, Panel("", *axes, series), tuple(legend))


def _chart(figures: Figures, title: str, how: str, panel: Panel, legend: tuple[Key, ...] = ()) -> Chart:
    machine = figures["machine"]
    counts = f"{figures['triangles']:,} triangles in {figures['meshes']:,} meshes, {figures['instances']:,} instances"
    footer = (
        f"{machine['processor']}, {machine['threads']} threads, {machine['isa']}; perfect_bvh {machine['perfect_bvh']}"
    )
    return Chart(
        title, f"{figures['scene']}: {counts}. {how}", [panel], footer, columns=1, panel_height=300, legend=legend
    )


def _total(figures: Figures, row: Figures, rays: float, which: str = "typical") -> float:
    return float(row["build_ms"][which] + rays / figures["rays"] * row["trace_ms"][which])


def _frame_ms(row: Figures, policy: str) -> float:
    return float(row["policies"][policy]["update_ms"] + row["policies"][policy]["trace_ms"])


def _within(share: float) -> float:
    return share if share <= 3.0 else float("nan")


def _more(ratio: float) -> str:
    return f"{100.0 * (ratio - 1.0):.0f} %"


def _rays(number: float) -> str:
    """To two digits."""
    unit = 10.0 ** math.floor(math.log10(number) - 1.0)
    rounded = round(number / unit) * unit
    return f"{rounded / 1e6:,.3g} million" if rounded >= 1e6 else f"{rounded:,.0f}"
