"""(g) How far images are from Cycles' converged one, against CPU time: ours and Cycles', raw and denoised."""

from __future__ import annotations

from charts.chart import Axis, Chart, Key, Panel, Series
from charts.figures import Figures, footer, load

DATA = "image_error"
# Colour and mark of each renderer; the denoised ones are filled.
LOOKS = {
    "ours": ("blue", "ring"),
    "ours, denoised": ("blue", "circle"),
    "Cycles": ("vermilion", "ring"),
    "Cycles, denoised": ("vermilion", "circle"),
}


def chart(figures: Figures | None = None) -> Chart:
    """The picture's description; figures: of image_error.py."""
    figures = figures or load(DATA)
    few, many = share_of_cycles(figures)
    worst = max(figures["cpu_to_equal_error"]["16"]["scenes"].items(), key=lambda item: item[1])
    return Chart(
        f"To the error of Cycles' 4 denoised samples ours take {few:.2f} of its CPU time, to that of 16 {many:.2f}",
        f"The example scenes as they are, {figures['width']} pixels wide, whole renders in Blender from the request to "
        f"the file, by turns; 1, 2, 4 ... {_most(figures)} samples a pixel. Error: root mean square difference after "
        f"the view transform from Cycles' {_converged(figures)} samples. Geometric means over the scenes; "
        f"the worst of 16: {worst[0]}, {worst[1]:.2f}. {_threads(figures)}; bars: quartiles.",
        [_panel(scene) for scene in figures["scenes"]],
        footer(figures),
        panel_height=230,
        legend=[Key(name, color, mark, line=True) for name, (color, mark) in LOOKS.items()],
    )


def share_of_cycles(figures: Figures) -> tuple[float, float]:
    """Our CPU time in parts of Cycles' to the error of its 4 and of its 16 samples, both denoised."""
    shares = figures["cpu_to_equal_error"]
    return float(shares["4"]["geometric_mean"]), float(shares["16"]["geometric_mean"])


def _most(figures: Figures) -> int:
    return int(figures["scenes"][0]["runs"][0]["points"][-1]["samples"])


def _converged(figures: Figures) -> str:
    counts = sorted({scene.get("converged_samples", figures["converged_samples"]) for scene in figures["scenes"]})
    return f"{counts[0]:,}" if len(counts) == 1 else f"{counts[0]:,} to {counts[-1]:,}"


def _threads(figures: Figures) -> str:
    threads = figures["machine"]["threads"]
    return "One thread" if threads == 1 else f"{threads} threads"


def _panel(scene: Figures) -> Panel:
    return Panel(
        scene["name"],
        Axis("CPU seconds", log=True),
        Axis("error, 1/255", log=True),
        [_series(run) for run in scene["runs"]],
    )


def _series(run: Figures) -> Series:
    points = run["points"]
    color, mark = LOOKS[run["name"]]
    return Series(
        run["name"],
        [point["cpu"]["median"] for point in points],
        [point["error"]["median"] for point in points],
        color,
        mark,
        low=[point["error"]["low"] for point in points],
        high=[point["error"]["high"] for point in points],
        x_low=[point["cpu"]["low"] for point in points],
        x_high=[point["cpu"]["high"] for point in points],
        line=True,
    )
