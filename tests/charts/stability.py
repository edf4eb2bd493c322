"""(h) Where each way of following a deformation fails: speed of rays, and answers, against how large it was."""

from __future__ import annotations

from charts.chart import Axis, Chart, Key, Panel, Series
from charts.figures import Figures, count, footer, load

DATA = "stability"
LOOKS = {  # label, colour, dashed
    "refit": ("refit", "orange", False),
    "rotate": ("refit and rotations", "purple", False),
    "rebuild_parts": ("refit and degraded parts rebuilt", "green", False),
    "governed": ("governed: the default", "blue", False),
}
LEFT_BEHIND = "black"
MOTIONS = {
    "twist": ("Twisted", "radians from end to end"),
    "explosion": ("Burst", "radii that the fastest flies"),
    "scale": ("Flattened along a diagonal", "thickness at rest over thickness"),
    "shear": ("Sheared", "sideways over upwards"),
}


def chart(figures: Figures | None = None) -> Chart:
    """The picture's description; figures: of stability.py."""
    figures = figures or load(DATA)
    rows = [row for motion in figures["motions"].values() for point in motion for row in point["policies"].values()]
    wrong, audited = sum(row["wrong"] for row in rows), sum(row["audited"] for row in rows)
    # A rebuilt tree is the new tree: its answers could not differ.
    kept = [row for row in rows if row["action"] != "rebuilt"]
    different, asked = sum(row["different"] for row in kept), len(kept) * figures["rays"]
    noise = _noise(figures)
    return Chart(
        "Refitted trees lose speed at a knee; where the governor sees it, it rebuilds",
        f"A mesh of {count(figures['triangles'])} triangles deforms in one step, ever more, and its tree follows. "
        "Speed of rays from all around, as a share of that through a new tree, on one thread; bands: quartiles. Where "
        f"the governor rebuilt, 1 is expected and {noise[0]:.2f} to {noise[1]:.2f} measured: that is the noise. Of "
        f"{count(asked)} answers through trees that were not rebuilt {different or 'none'} differ from the new tree's, "
        f"of {count(audited)} audited ones {wrong or 'none'} are wrong. Black: answers if nothing is updated.",
        [panel for motion in MOTIONS for panel in (_speeds(figures, motion), _answers(figures, motion))],
        footer(figures),
        panel_height=225,
        legend=(
            *(Key(label, color, "circle", True, dashed) for label, color, dashed in LOOKS.values()),
            Key("rebuild: a new tree", "pale", "", True),
            Key("no update", LEFT_BEHIND, "square", True, True),
        ),
    )


def _noise(figures: Figures) -> tuple[float, float]:
    """Least and greatest share of the new tree's speed that was measured through trees that are no worse."""
    governed = [point["policies"]["governed"] for motion in figures["motions"].values() for point in motion]
    shares = [row["speed"]["median"] for row in governed if row["action"] == "rebuilt"]
    return min(shares), max(shares)


def _speeds(figures: Figures, motion: str) -> Panel:
    points = figures["motions"][motion]
    title, label = MOTIONS[motion]
    amounts = [point["amount"] for point in points]
    series = [Series("a new tree", [amounts[0], amounts[-1]], [1.0, 1.0], "pale", "", line=True, width=3.0)]
    for policy, (words, color, dashed) in LOOKS.items():
        speeds = [point["policies"][policy]["speed"] for point in points]
        series.append(
            Series(
                words,
                amounts,
                [speed["median"] for speed in speeds],
                color,
                "circle",
                low=[speed["low"] for speed in speeds],
                high=[speed["high"] for speed in speeds],
                line=True,
                dashed=dashed,
                size=6.0,
            )
        )
    top = max(1.15, *(row["policies"][policy]["speed"]["high"] for row in points for policy in LOOKS))
    return Panel(
        f"{title}: speed",
        Axis(label, log=True),
        Axis("speed over that through a new tree", high=top * 1.05),
        series,
    )


def _answers(figures: Figures, motion: str) -> Panel:
    """Marks within marks: all that is at 0 can be seen."""
    points = figures["motions"][motion]
    title, label = MOTIONS[motion]
    amounts = [point["amount"] for point in points]
    share = 1e6 / figures["rays"]
    series = [
        Series(
            words,
            amounts,
            [share * point["policies"][policy]["different"] for point in points],
            color,
            "ring" if size > 5.0 else "circle",
            line=True,
            size=size,
        )
        for (policy, (words, color, _)), size in zip(LOOKS.items(), (17.0, 13.0, 9.0, 5.0), strict=True)
    ]
    late = [share * point["left_behind"] for point in points]
    series.append(Series("no update", amounts, late, LEFT_BEHIND, "square", line=True, dashed=True, size=6.0))
    return Panel(
        f"{title}: answers",
        Axis(label, log=True),
        Axis("unlike a new tree's, rays per million", log=True, has_zero=True, low=100.0, high=1e6, powers=True),
        series,
    )
