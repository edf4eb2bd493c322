"""(b) Build and rays together, against how many rays there are: from when on a better tree pays."""

from __future__ import annotations

import math

from charts.chart import Axis, Chart, Key, Panel, Series
from charts.figures import Figures, count, footer, load, named, rounds_of

DATA = "builders"
MESHES = ("sponza", "dragon", "hair", "sticks")
KIND = "diffuse"
TREES = {  # name in the figures: colour, dashed
    "fast": ("sky", False),
    "auto": ("blue", False),
    "sweep": ("purple", False),
    "spatial": ("green", False),
    "embree_low": ("orange", True),
    "embree_medium": ("vermilion", True),
    "embree_high": ("black", True),
}
LABELS = {"embree_low": "Embree LOW", "embree_medium": "Embree MEDIUM", "embree_high": "Embree HIGH"}
COUNTS = [10.0 ** (3.0 + i / 12.0) for i in range(12 * 6 + 1)]
BUILT_AS = {"fast": "fast", "binned": "auto", "spatial": "spatial"}  # the measured tree by the planner's builder

HIGHEST = 3.0  # times the least, that is shown


def chart(figures: Figures | None = None) -> Chart:
    """The picture's description; figures: of build.py."""
    figures = figures or load(DATA)
    meshes = [mesh for mesh in figures["meshes"] if mesh["name"] in MESHES]
    return Chart(
        "A dearer tree pays with rays enough; the planner guesses from when on",
        "Time to build and to cast so many diffuse rays, on one thread, as a multiple of the least of ours at that "
        "number: 1 is the best choice. Rings: what the planner takes for so many, of which it is told a "
        "quarter, because it reckons that a still mesh's tree serves four commits. It knows what builders cost on two "
        "meshes of its calibration, not on this one, and it never takes sweep. Bands: "
        f"quartiles of {rounds_of(meshes)}.",
        [_panel(mesh) for mesh in meshes],
        footer(figures),
        panel_height=285,
        legend=(
            *(Key(LABELS.get(name, name), color, "", True, dash) for name, (color, dash) in TREES.items()),
            Key("the planner's choice", "black", "ring"),
            Key("break-even: the best of ours from so many rays on", "black", "diamond"),
        ),
    )


def _panel(mesh: Figures) -> Panel:
    trees = {name: tree for name, tree in named(mesh["trees"]).items() if name in TREES}
    best = [min(_milliseconds(t, rays) for n, t in trees.items() if not n.startswith("embree")) for rays in COUNTS]
    series = []
    for name, tree in trees.items():
        color, dashed = TREES[name]
        share = [_seen(_milliseconds(tree, rays) / least) for rays, least in zip(COUNTS, best, strict=True)]
        low, high = (
            [_seen(_milliseconds(tree, rays, quartile) / least) for rays, least in zip(COUNTS, best, strict=True)]
            for quartile in ("low", "high")
        )
        label = LABELS.get(name, name)
        series.append(Series(label, COUNTS, share, color, "", low=low, high=high, line=True, dashed=dashed))
    chosen = paid_for_choices(mesh)
    rays, paid = [rays for rays, _, _ in chosen], [share for _, _, share in chosen]
    series.append(Series("the planner's choice", rays, paid, "black", "ring", size=10.0))
    crossings = list(_crossings(trees))
    series.append(
        Series(
            "break-even",
            [rays for rays, _ in crossings],
            [1.0] * len(crossings),
            "black",
            "diamond",
            labels="points",
            names=[f"{name} {_rays(rays)}" for rays, name in crossings],
        )
    )
    return Panel(
        f"{mesh['name']}: {count(mesh['triangle_count'])} triangles",
        Axis("diffuse rays cast at the tree", log=True, low=COUNTS[0], high=COUNTS[-1]),
        Axis("build + rays, times the least", low=0.4, high=HIGHEST),
        series,
    )


def paid_for_choices(mesh: Figures) -> list[tuple[float, str, float]]:
    """Returns, for each number of rays, the planner's tree and the ratio of its time to that of our best tree."""
    trees = {name: tree for name, tree in named(mesh["trees"]).items() if name in TREES}
    ours = [tree for name, tree in trees.items() if not name.startswith("embree")]
    chosen = [(row["rays"], BUILT_AS[row["builder"]]) for row in mesh["planner"] if row["rays"] <= COUNTS[-1]]
    return [
        (rays, name, _milliseconds(trees[name], rays) / min(_milliseconds(tree, rays) for tree in ours))
        for rays, name in chosen
    ]


def _seen(share: float) -> float:
    return share if share <= HIGHEST else math.nan


def _milliseconds(tree: Figures, rays: float, quartile: str = "median") -> float:
    """quartile: of times, "low" or "high", for the spread."""
    kind = tree["rays"][KIND]
    speed = kind["mrays_per_second"]
    if quartile != "median":
        # The low quartile of a time is the high quartile of a speed.
        ends = [kind["rounds"]["low"], kind["rounds"]["high"], speed]
        speed = max(ends) if quartile == "low" else min(ends)
    return float(tree["ready_ms"]["1"][quartile] + rays / (1e3 * speed))


def _crossings(trees: dict[str, Figures]) -> list[tuple[float, str]]:
    """Returns the numbers of rays at which the best of our builders changes, each with the new best."""
    ours = [name for name in trees if not name.startswith("embree")]
    found: list[tuple[float, str]] = []
    before = None
    for i in range(6 * 60 + 1):
        rays = 10.0 ** (3.0 + i / 60.0)
        best = min(ours, key=lambda name: _milliseconds(trees[name], rays))
        if before is not None and best != before:
            found.append((rays, best))
        before = best
    return found


def _rays(number: float) -> str:
    power = 10.0 ** math.floor(math.log10(number) - 1.0)
    rounded = round(number / power) * power
    return f"{rounded / 1e6:.3g}M" if rounded >= 1e6 else f"{rounded / 1e3:.3g}k"
