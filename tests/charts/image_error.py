"""(g) How far a picture is from its converged self, against time: the preview, clay, and Cycles beside them."""

from __future__ import annotations

from charts.figures import Figures, footer, load

from addon.bench.chart import Axis, Chart, Panel, Series

DATA = "image_error"
COLORS = {"preview": "blue", "preview, smoothed": "sky", "Cycles": "vermilion", "clay": "green"}


def chart(figures: Figures | None = None) -> Chart:
    """The picture's description; figures: of image_error.py."""
    figures = figures or load(DATA)
    runs = {run["name"]: run for run in figures["runs"]}
    first = [runs[name] for name in COLORS]
    radii = [run for name, run in runs.items() if name == "clay" or "radius" in name]
    widths = sorted(
        (run for name, run in runs.items() if name == "clay" or "wide" in name), key=lambda run: run["width"]
    )
    faster = _times_faster(runs["preview"], runs["Cycles"])
    return Chart(
        f"At equal error the preview's rays are {faster:.1f} times as fast as Cycles'",
        f"{figures['scene']}, one matt material under a white sky, one bounce, {runs['preview']['width']} pixels wide; "
        "1, 4 ... 64 samples a pixel. Error: root mean square difference from the renderer's own image of 4,096 "
        "samples, over its mean; the two such images are "
        f"{100 * figures['preview_from_cycles']:.0f} % apart. {faster:.1f}: from one image of 4,096 samples each. "
        "Cycles reads the scene and writes a file in each render; its rays alone are the total less a start of "
        f"{runs['Cycles']['sync_ms']:.0f} ms, estimated from the slope over samples. Hollow: that gave less than the "
        "slope, to which it was raised; in all, too, it took less than is drawn. "
        f"{_threads(figures)} each, no denoiser; bars: quartiles.",
        [
            Panel("Rays alone", _time("milliseconds of rendering"), _error(), _drawn(first)),
            Panel(
                "With reading the scene and building its trees",
                _time("milliseconds in all"),
                _error(),
                _drawn(first, in_all=True),
            ),
            Panel(
                "Clay: radius of the occlusion", _time("milliseconds of rendering"), _error(), _shades(radii, _radius)
            ),
            Panel(
                "Clay: width of the picture",
                _time("milliseconds of rendering"),
                _error(),
                _shades(widths, lambda run: f"{run['width']} pixels"),
            ),
        ],
        footer(figures),
        panel_height=270,
    )


def _threads(figures: Figures) -> str:
    threads = figures["machine"]["threads"]
    return "One thread" if threads == 1 else f"{threads} threads"


def _time(label: str) -> Axis:
    return Axis(label, log=True)


def _error() -> Axis:
    return Axis("relative error, %", log=True)


def _drawn(runs: list[Figures], *, in_all: bool = False) -> list[Series]:
    """The runs, and over them hollow marks where times are no measurement."""
    waits = [run["sync_ms"] if in_all else 0.0 for run in runs]
    lines = [_series(run, wait) for run, wait in zip(runs, waits, strict=True)]
    for run, wait in zip(runs, waits, strict=True):
        raised = [point for point in run["points"] if _is_raised(run, point)]
        xs, ys = [point["ms"]["median"] + wait for point in raised], [100.0 * p["error"]["median"] for p in raised]
        lines.append(Series(run["name"], xs, ys, COLORS[run["name"]], "ring", size=9.0))
    return lines


def _is_raised(run: Figures, point: Figures) -> bool:
    """image_error.py lets no time that it reckoned fall below the slope times the samples."""
    if not run["reads_each_time"]:
        return False
    slope = min(each["ms"]["low"] / each["samples"] for each in run["points"])
    return bool(point["ms"]["median"] <= slope * point["samples"] * 1.001)


def _series(run: Figures, sync_ms: float, name: str = "", color: str = "") -> Series:
    points = run["points"]
    return Series(
        name or run["name"],
        [point["ms"]["median"] + sync_ms for point in points],
        [100.0 * point["error"]["median"] for point in points],
        color or COLORS[run["name"]],
        "circle",
        low=[100.0 * point["error"]["low"] for point in points],
        high=[100.0 * point["error"]["high"] for point in points],
        x_low=[point["ms"]["low"] + sync_ms for point in points],
        x_high=[point["ms"]["high"] + sync_ms for point in points],
        line=True,
        labels="end",
    )


def _shades(runs: list[Figures], label: object) -> list[Series]:
    colors = ("sky", "blue", "black")
    return [_series(run, 0.0, label(run), color) for run, color in zip(runs, colors, strict=True)]  # type: ignore[operator]


def _radius(run: Figures) -> str:
    return (
        "all of it"
        if run["name"] == "clay"
        else run["name"].removeprefix("clay, ").removesuffix(" of the radius") + " of it"
    )


def _times_faster(run: Figures, other: Figures) -> float:
    """By how much less time at equal error: errors fall as 1 / sqrt(samples), so time times squared error is fixed.

    The time of a sample is that of the longest render, which whatever else the machine does disturbs least.
    """

    def work(which: Figures) -> float:
        last = which["points"][-1]
        sync_ms = which["sync_ms"] if which["reads_each_time"] else 0.0
        return float((which["converged_ms"] - sync_ms) * last["samples"] * last["error"]["median"] ** 2)

    return work(other) / work(run)
