"""(c) The cost of each frame of an animation with refits only, with rebuilds only, and as the governor decides."""

from __future__ import annotations

import math

from charts.chart import Axis, Chart, Key, Mark, Panel, Series
from charts.figures import Figures, count, footer, load, named

DATA = "policies"
ANIMATIONS = ("tree_in_wind", "cloth", "ocean", "exploding")  # in the others nothing deforms
LOOKS = {
    "refit": ("always refit", "orange"),
    "rebuild": ("always rebuild", "vermilion"),
    "governed": ("governed", "blue"),
}
DECISIONS: dict[str, tuple[str, Mark]] = {
    "rebuilt": ("rebuilt", "square"),
    "partly_rebuilt": ("degraded parts rebuilt", "diamond"),
    "rotated": ("refitted and rotated", "triangle"),
    "refitted": ("refitted", "ring"),
}


def chart(figures: Figures | None = None) -> Chart:
    """The picture's description; figures: of sync.py --policies."""
    figures = figures or load(DATA)
    animations = [named(figures["policies"])[name] for name in ANIMATIONS]
    most = 100.0 * (max(_governed_to_better(animation["policies"]) for animation in animations) - 1.0)
    taken = {_dearest(row) for animation in animations for row in animation["policies"]["governed"]["frames"]}
    rays, timed = animations[0]["rays"], animations[0]["timed_rays"]
    return Chart(
        f"In sum the governor costs at most {math.ceil(most)} % more than the better fixed policy",
        f"Update of the trees and {count(rays)} rays from all around after it, on one thread: {count(timed)} are "
        "timed and reckoned up. Bands: quartiles; where they cover one another, policies cannot be "
        "told apart. Black marks: what the governor did. The number in each heading is the governed sum over that of "
        "the better fixed policy, after the first frame, in which all build the same. Ocean's triangles are replaced "
        "in each frame, which makes every policy rebuild.",
        [_panel(animation) for animation in animations],
        footer(figures),
        panel_height=270,
        legend=(
            *(Key(label, color, "", True) for label, color in LOOKS.values()),
            *(Key(words, "black", mark) for action, (words, mark) in DECISIONS.items() if action in taken),
        ),
    )


def _panel(animation: Figures) -> Panel:
    numbers, policies = animation["frames"], animation["policies"]
    series = []
    for policy, (label, color) in LOOKS.items():
        times = [row["all_ms"] for row in policies[policy]["frames"]]
        middles, low, high = ([time[key] for time in times] for key in ("median", "low", "high"))
        series.append(Series(label, numbers, middles, color, "", low=low, high=high, line=True))
    for action, (words, mark) in DECISIONS.items():
        # The most expensive action where several meshes changed at once.
        rows = policies["governed"]["frames"]
        places = [i for i, row in enumerate(rows) if _dearest(row) == action]
        ys = [rows[i]["all_ms"]["median"] for i in places]
        series.append(Series(words, [numbers[i] for i in places], ys, "black", mark, size=7.0))
    ratio = _governed_to_better(policies)
    title = f"{animation['name']}: {count(animation['triangles'])} triangles; governed {ratio:.2f}"
    return Panel(title, Axis("frame", low=numbers[0] - 1.0), Axis("milliseconds: update and rays"), series)


def _dearest(frame: Figures) -> str | None:
    return next((action for action in DECISIONS if action in frame["actions"]), None)


def _governed_to_better(policies: Figures) -> float:
    """Returns the governed sum relative to the better of the other two, after the first frame."""
    sums = {name: sum(row["all_ms"]["median"] for row in policies[name]["frames"][1:]) for name in LOOKS}
    return float(sums["governed"] / min(sums["refit"], sums["rebuild"]))
