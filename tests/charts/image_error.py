"""(g) How far a picture is from its converged self, against time: the preview, clay, and Cycles beside them."""

from __future__ import annotations

from charts.chart import Axis, Chart, Panel, Series
from charts.figures import Figures, footer, load

DATA = "image_error"
RADII = ("clay, half as wide", "clay, 0.25 of the radius", "clay, 0.0625 of the radius")
WIDTHS = ("clay", "clay, half as wide", "clay, a quarter as wide")
COLORS = {"preview": "blue", "preview, smoothed": "sky", "Cycles": "vermilion", "clay": "green"}


def chart(figures: Figures | None = None) -> Chart:
    """The picture's description; figures: of image_error.py."""
    figures = figures or load(DATA)
    runs = {run["name"]: run for run in figures["runs"]}
    first = [runs[name] for name in COLORS]
    faster, faster_in_all = times_faster(figures)
    most = runs["preview"]["points"][-1]["samples"]
    return Chart(
        f"At equal error the preview's rays are {faster:.1f} times as fast as Cycles'; in all, {faster_in_all:.1f}",
        f"{figures['scene']}, one diffuse material under a white sky, one bounce, {runs['preview']['width']} pixels "
        "wide; "
        f"1, 4 ... {most} samples a pixel. Error: root mean square difference, in the middle of the image (a fifth as "
        f"wide and high), from the renderer's own {figures['converged_samples']:,} samples there, over their mean; the "
        f"two are {100 * figures['preview_from_cycles']:.0f} % apart. {faster:.1f} and {faster_in_all:.1f}: at "
        f"{most} samples, errors made equal by more of them. In all: with what a "
        f"render in Blender takes beside its rays, {_spread(runs['preview'])} ms with the preview ({figures['starts']} "
        f"renders that knew nothing of the scene), {_spread(runs['Cycles'])} ms, reckoned, with Cycles, of which only "
        f"totals are measured (hollow: less that). "
        f"{_threads(figures)} each, no denoiser; bars: quartiles.",
        [
            Panel("Rays alone", _time("milliseconds of rendering"), _error(), [_series(run) for run in first]),
            Panel(
                "With reading the scene and building its trees",
                _time("milliseconds in all"),
                _error(),
                [_series(run, "total_ms") for run in first],
            ),
            Panel(
                f"Clay {runs[RADII[0]]['width']} pixels wide: radius of the occlusion",
                _time("milliseconds of rendering"),
                _error(),
                _shades([runs[name] for name in RADII], ["all of it", "a quarter", "a sixteenth"]),
            ),
            Panel(
                "Clay: width of the picture",
                _time("milliseconds of rendering"),
                _error(),
                _shades([runs[name] for name in WIDTHS], [f"{runs[name]['width']} pixels" for name in WIDTHS]),
            ),
        ],
        footer(figures),
        panel_height=270,
    )


def _spread(run: Figures) -> str:
    """The time that a renderer takes before its first ray: its median and quartiles."""
    start = run["sync_ms"]
    return f"{start['median']:.0f} ({start['low']:.0f} to {start['high']:.0f})"


def times_faster(figures: Figures) -> tuple[float, float]:
    """By how much less time the preview takes than Cycles at equal error: its rays alone, and in all."""
    runs = {run["name"]: run for run in figures["runs"]}
    rays, in_all = (_times_faster(runs["preview"], runs["Cycles"], which) for which in ("ms", "total_ms"))
    return rays, in_all


def _threads(figures: Figures) -> str:
    threads = figures["machine"]["threads"]
    return "One thread" if threads == 1 else f"{threads} threads"


def _time(label: str) -> Axis:
    return Axis(label, log=True)


def _error() -> Axis:
    return Axis("relative error, %", log=True)


def _series(run: Figures, which: str = "ms", name: str = "", color: str = "") -> Series:
    points = run["points"]
    return Series(
        name or run["name"],
        [point[which]["median"] for point in points],
        [100.0 * point["error"]["median"] for point in points],
        color or COLORS[run["name"]],
        "ring" if run["reads_each_time"] and which == "ms" else "circle",
        low=[100.0 * point["error"]["low"] for point in points],
        high=[100.0 * point["error"]["high"] for point in points],
        x_low=[point[which]["low"] for point in points],
        x_high=[point[which]["high"] for point in points],
        line=True,
        labels="end",
    )


def _shades(runs: list[Figures], labels: list[str]) -> list[Series]:
    colors = ("black", "blue", "sky")
    return [_series(run, "ms", label, color) for run, label, color in zip(runs, labels, colors, strict=True)]


def _times_faster(run: Figures, other: Figures, which: str) -> float:
    """By how much less time at equal error: errors fall as 1 / sqrt(samples), so rays' time times error² stays.

    In all: the other's total at its most samples, over this one's start and what rays it then takes.
    """
    mine, theirs = run["points"][-1], other["points"][-1]
    rays = mine["ms"]["median"] * (mine["error"]["median"] / theirs["error"]["median"]) ** 2
    start = mine["total_ms"]["median"] - mine["ms"]["median"] if which == "total_ms" else 0.0
    return float(theirs[which]["median"] / (start + rays))
