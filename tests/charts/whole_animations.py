"""(i) What a ray costs from frame to frame: one tree for a whole animation, beside the other ways of following it."""

from __future__ import annotations

from charts.chart import Axis, Chart, Key, Panel, Series
from charts.figures import Figures, count, footer, geometric_mean, load

DATA = "animation"
LOOKS = {  # label, colour, dashed
    "rebuild": ("a new tree in each frame", "pale", False),
    "refit": ("the first frame's, refitted", "orange", False),
    "animate": ("one for all frames, refitted", "green", False),
    "governed": ("governed: the default", "blue", True),
}


def chart(figures: Figures | None = None) -> Chart:
    """The picture's description; figures: of animation.py."""
    figures = figures or load(DATA)
    animations = figures["animations"]
    lost = {way: geometric_mean([_mean(row, way) / _mean(row, "rebuild") for row in animations]) for way in LOOKS}
    return Chart(
        f"One tree for all frames costs rays {lost['animate']:.2f} times new ones; the first, {lost['refit']:.2f}",
        "Visits to nodes that a ray is expected to make, counted, by frame, in the last of "
        f"{figures['plays']} plays in a row. The governor is told of the shapes and of {count(figures['rays'])} rays a "
        "frame, and goes by time: it may rebuild. The title's numbers are geometric means over the animations.",
        [_panel(row) for row in animations],
        footer(figures),
        panel_height=215,
        legend=tuple(Key(label, color, "", True, dashed) for label, color, dashed in LOOKS.values()),
    )


def _mean(animation: Figures, way: str) -> float:
    costs = animation["ways"][way]["costs"]
    return float(sum(costs) / len(costs))


def _panel(animation: Figures) -> Panel:
    ways = animation["ways"]
    frames = list(range(1, animation["frames"] + 1))
    series = [
        Series(
            label,
            frames,
            ways[way]["costs"],
            color,
            "",
            line=True,
            dashed=dashed,
            width=3.0 if way == "rebuild" else 1.8,
        )
        for way, (label, color, dashed) in LOOKS.items()
    ]
    title = f"{animation['name']}: {count(animation['triangles'])} triangles"
    return Panel(title, Axis("frame"), Axis("visits a ray", log=True), series)
