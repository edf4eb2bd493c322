"""(d) Lost or inexact answers where coordinates are hard, and the cost in speed of not losing them."""

from __future__ import annotations

from charts.chart import Axis, Chart, Key, Mark, Panel, Series
from charts.figures import Figures, count, footer, load

DATA = "accuracy"
LOOKS: dict[str, tuple[str, str, Mark]] = {  # label, colour, mark
    "perfect_bvh": ("Perfect BVH", "blue", "circle"),
    "perfect_bvh, placed by its matrix": ("Perfect BVH, placed by a matrix", "green", "ring"),
    "embree": ("Embree 4.4", "vermilion", "diamond"),
    "embree_robust": ("Embree ROBUST", "orange", "diamond"),
    "BVHTree": ("Blender's BVHTree", "grey", "square"),
    "scene.ray_cast": ("scene.ray_cast", "black", "square"),
}
SWEEPS = {
    "offset": ("Away from the origin", "distance from the origin, in radii"),
    "scale": ("Scaled", "radius"),
    "aspect": ("Stretched: slivers", "length of triangles over width"),
}


GROUNDS = {"flat": "Large triangles, flat", "aslant": "Large triangles, aslant"}


def chart(figures: Figures | None = None) -> Chart:
    """The picture's description; figures: of accuracy.py."""
    figures = figures or load(DATA)
    answers = figures["sweeps"]["offset"][0]["vertices"]
    rays, few = answers["perfect_bvh"]["rays"], answers.get("BVHTree", {}).get("rays", 0)
    bound = max(row["high"] for row in answers.values() if row["rays"] == rays and not row["missed_per_million"])
    rows = [row["vertices"] for sweep in figures["sweeps"].values() for row in sweep]
    lost = max(row["perfect_bvh"]["missed_per_million"] for row in rows)
    exact = figures["exact"]
    lost = max(lost, *(row["answers"]["perfect_bvh"]["wrong_per_million"] for row in exact["distances"]))
    worst = max(row.get("embree_robust", {}).get("missed_per_million", 0.0) for row in rows)
    ours = f"{lost:,.0f} in a million" if lost else "no ray"
    return Chart(
        f"Our kernels lose {ours} here, about as fast as kernels that do",
        "Rays from within a closed sphere, at its vertices: where none may get through, some do. Of "
        f"{count(rays)} rays at each sphere ({count(few)} for Blender's); 0 is none of them, which leaves up to "
        f"{bound:.0f} in a million possible. Embree ROBUST loses up to {worst:,.0f}. Of marks at 0, ours hide others. "
        "Dashed: rays at random points of the surface, where any of those are lost. Bands: 95 % confidence. Bars of "
        f"speeds: quartiles. Outlines: {count(exact['rays'])} rays from outside, which meet a box's vertices and edges "
        "exactly or pass them by a float; whole numbers say who loses or makes up a hit. Large triangles: rays whose t "
        "is off by more than a millionth of itself, on a ground of two triangles whose middle rays meet from one to "
        "three units above it.",
        [
            *(_panel(figures, sweep) for sweep in SWEEPS),
            _outlines(exact["distances"]),
            *(_ground(figures, each) for each in GROUNDS),
            _frontier(figures),
        ],
        f"{footer(figures)}. Outlines: {footer(exact)}",
        panel_height=275,
        legend=tuple(Key(label, color, mark) for label, color, mark in LOOKS.values()),
    )


def _panel(figures: Figures, sweep: str) -> Panel:
    rows = figures["sweeps"][sweep]
    title, label = SWEEPS[sweep]
    series = []
    for name, (words, color, mark) in reversed(LOOKS.items()):
        if name not in rows[0]["vertices"]:
            continue
        lost = [row["vertices"][name] for row in rows]
        values = [row["value"] for row in rows]
        low, high = [row["low"] for row in lost], [row["high"] if row["missed_per_million"] else 0.0 for row in lost]
        ys = [row["missed_per_million"] for row in lost]
        size = 13.0 if mark == "ring" else 7.0  # about the mark that it would hide
        series.append(Series(words, values, ys, color, mark, low=low, high=high, line=True, size=size))
        natural = [row["surface"][name]["missed_per_million"] for row in rows]
        if any(natural):
            series.append(Series(words, values, natural, color, "", line=True, dashed=True))
    has_zero = rows[0]["value"] == 0.0
    return Panel(
        title,
        Axis(label, log=True, has_zero=has_zero, powers=True),
        Axis("rays lost per million", log=True, has_zero=True, low=10.0, high=1e6, powers=True),
        series,
    )


def _ground(figures: Figures, which: str) -> Panel:
    rows = figures["grounds"][which]
    series = []
    for name, (words, color, mark) in reversed(LOOKS.items()):
        if name in rows[0]["t"]:
            errors = [row["t"][name]["off_per_million"] for row in rows]
            series.append(Series(words, [row["value"] for row in rows], errors, color, mark, line=True))
    return Panel(
        GROUNDS[which],
        Axis("side of the ground", log=True, powers=True),
        Axis("rays off per million", log=True, has_zero=True, low=10.0, high=1e6, powers=True),
        series,
    )


def _outlines(rows: list[Figures]) -> Panel:
    series = []
    for name, (words, color, mark) in reversed(LOOKS.items()):
        if name in rows[0]["answers"]:
            wrong = [row["answers"][name] for row in rows]
            ys = [row["wrong_per_million"] for row in wrong]
            low, high = (
                [row["low"] for row in wrong],
                [row["high"] if y else 0.0 for row, y in zip(wrong, ys, strict=True)],
            )
            values = [row["value"] for row in rows]
            series.append(Series(words, values, ys, color, mark, low=low, high=high, line=True))
    return Panel(
        "Outlines, from outside",
        Axis("distance of the rays' origins, in sides of the box", log=True, powers=True),
        Axis("rays lost or made up per million", low=0.0),
        series,
    )


def _frontier(figures: Figures) -> Panel:
    """Draws speed over lost answers for the undeformed sphere."""
    lost = next(row for row in figures["sweeps"]["scale"] if row["value"] == 1.0)["vertices"]
    series = []
    for name, (words, color, mark) in LOOKS.items():
        if name not in figures["speeds"] or name not in lost:
            continue
        speed, row = figures["speeds"][name], lost[name]
        high = row["high"] if row["missed_per_million"] else 0.0
        series.append(
            Series(
                words,
                [speed["median"]],
                [row["missed_per_million"]],
                color,
                mark,
                low=[row["low"]],
                high=[high],
                x_low=[speed["low"]],
                x_high=[speed["high"]],
                size=10.0,
                labels="points",
                names=[words.replace("Blender's ", "")],
            )
        )
    return Panel(
        "Speed against losses, radius 1",
        Axis("million diffuse rays a second; Blender's from Python"),
        Axis("rays lost per million", log=True, has_zero=True, low=10.0, high=1e6, powers=True),
        series,
    )
