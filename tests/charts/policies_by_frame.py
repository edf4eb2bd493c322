"""(c) What each frame of an animation costs by always refitting, always rebuilding, and as the governor decides."""

from __future__ import annotations

import math

from charts.figures import Figures, count, footer, load

from addon.bench.chart import Axis, Chart, Key, Mark, Panel, Series

DATA = "frames"
LOOKS = {
    "refit": ("always refit", "orange"),
    "rebuild": ("always rebuild", "vermilion"),
    "governed": ("governed", "blue"),
}
DECISIONS: dict[str, tuple[str, Mark]] = {
    "rebuilt": ("rebuilt", "square"),
    "partly_rebuilt": ("spoilt parts rebuilt", "diamond"),
    "rotated": ("refitted and rotated", "triangle"),
    "refitted": ("refitted", "ring"),
}


def chart(figures: Figures | None = None) -> Chart:
    """The picture's description; figures: of frames.py."""
    figures = figures or load(DATA)
    most = 100.0 * (max(_governed_to_better(animation["frames"]) for animation in figures["animations"]) - 1.0)
    frames = [row for animation in figures["animations"] for row in animation["frames"]]
    taken = {_dearest(row["policies"]["governed"]["actions"]) for row in frames}
    return Chart(
        f"In sum the governor costs at most {math.ceil(most)} % more than the better fixed policy",
        f"Update of the trees and {count(figures['rays'])} rays after it, on one thread: a sample of about 30 thousand "
        "is timed and multiplied. Bands: quartiles; where they cover one another, policies cannot be "
        "told apart. Black marks: what the governor did. The number in each heading is the governed sum over that of "
        "the better fixed policy, after the first frame, in which all build the same. Ocean's triangles are replaced "
        "in each frame, which makes every policy rebuild.",
        [_panel(animation) for animation in figures["animations"]],
        footer(figures),
        panel_height=270,
        legend=(
            *(Key(label, color, "", True) for label, color in LOOKS.values()),
            *(Key(words, "black", mark) for action, (words, mark) in DECISIONS.items() if action in taken),
        ),
    )


def _panel(animation: Figures) -> Panel:
    frames = animation["frames"]
    numbers = [row["frame"] for row in frames]
    series = []
    for policy, (label, color) in LOOKS.items():
        times = [row["policies"][policy]["all_ms"] for row in frames]
        middles, low, high = ([time[key] for time in times] for key in ("median", "low", "high"))
        series.append(Series(label, numbers, middles, color, "", low=low, high=high, line=True))
    for action, (words, mark) in DECISIONS.items():
        # The dearest of what was done to several meshes at once.
        rows = [row["policies"]["governed"] for row in frames]
        places = [i for i, row in enumerate(rows) if _dearest(row["actions"]) == action]
        ys = [rows[i]["all_ms"]["median"] for i in places]
        series.append(Series(words, [numbers[i] for i in places], ys, "black", mark, size=7.0))
    ratio = _governed_to_better(frames)
    title = f"{animation['name']}: {count(animation['triangles'])} triangles; governed {ratio:.2f}"
    return Panel(title, Axis("frame", low=numbers[0] - 1.0), Axis("milliseconds: update and rays"), series)


def _dearest(actions: list[str]) -> str | None:
    return next((action for action in DECISIONS if action in actions), None)


def _governed_to_better(frames: list[Figures]) -> float:
    sums = {policy: sum(row["policies"][policy]["all_ms"]["median"] for row in frames[1:]) for policy in LOOKS}
    return float(sums["governed"] / min(sums["refit"], sums["rebuild"]))
