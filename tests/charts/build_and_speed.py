"""(a) The cost of building a tree, over the speed of rays in it: every builder, Embree's and Blender's."""

from __future__ import annotations

from typing import Any

from charts.chart import BLENDER, EMBREE, OURS, Axis, Chart, Key, Panel, Series
from charts.figures import Figures, count, footer, load, only, rounds_of

DATA = "builders"
MESHES = ("sponza", "dragon", "hair", "sticks")
KIND = "diffuse"
NAMES = {"embree_low": "LOW", "embree_medium": "MEDIUM", "embree_high": "HIGH"}


def chart(figures: Figures | None = None) -> Chart:
    """The picture's description; figures: of build.py."""
    figures = figures or load(DATA)
    meshes = [mesh for mesh in figures["meshes"] if mesh["name"] in MESHES]
    return Chart(
        "Cheap trees cost rays, dear trees cost time: what each builder buys",
        "Time from a mesh in memory until rays can be cast, and speed of diffuse bounce rays, both on one thread: up "
        "and to the left is better. On the grey line nothing is better in both. Bars: quartiles "
        f"of {rounds_of(meshes)}.",
        [_panel(mesh) for mesh in meshes],
        footer(figures),
        panel_height=285,
        legend=(
            Key("Perfect BVH (auto: what meshes get)", OURS),
            Key("Embree 4.4, by build quality", EMBREE, "diamond"),
            Key("from Python: embreex, Blender's BVHTree", BLENDER, "square"),
        ),
    )


def _panel(mesh: Figures) -> Panel:
    ours = [tree for tree in mesh["trees"] if not tree["name"].startswith("embree")]
    embree = [tree for tree in mesh["trees"] if tree["name"].startswith("embree")]
    python = [only(mesh["from_python"], name) for name in ("embreex", "BVHTree") if _has(mesh, name)]
    everyone = [_point(tree, "1") for tree in mesh["trees"]]
    return Panel(
        f"{mesh['name']}: {count(mesh['triangle_count'])} triangles",
        Axis("milliseconds until ready to trace", log=True),
        Axis("million diffuse rays a second"),
        [
            _frontier(everyone),
            _series("Embree", embree, EMBREE, "diamond"),
            _series("Python", python, BLENDER, "square"),
            _series("ours", ours, OURS, "circle"),
        ],
    )


def _has(mesh: Figures, name: str) -> bool:
    return any(row["name"] == name for row in mesh["from_python"])


def _point(tree: Figures, threads: str) -> tuple[float, float]:
    ready = tree["ready_ms"].get(threads, tree["ready_ms"])
    return ready["median"], tree["rays"][KIND]["mrays_per_second"]


def _series(name: str, trees: list[Figures], color: str, mark: Any) -> Series:
    ready = [tree["ready_ms"].get("1", tree["ready_ms"]) for tree in trees]
    rays = [tree["rays"][KIND] for tree in trees]
    return Series(
        name,
        [time["median"] for time in ready],
        [speed["mrays_per_second"] for speed in rays],
        color,
        mark,
        low=[min(speed["rounds"]["low"], speed["mrays_per_second"]) for speed in rays],
        high=[max(speed["rounds"]["high"], speed["mrays_per_second"]) for speed in rays],
        x_low=[time["low"] for time in ready],
        x_high=[time["high"] for time in ready],
        labels="points",
        names=[NAMES.get(tree["name"], tree["name"]) for tree in trees],
    )


def _frontier(points: list[tuple[float, float]]) -> Series:
    """Returns the points for which no other is both faster to build and faster to trace."""
    best: list[tuple[float, float]] = []
    for time, speed in sorted(points):
        if not best or speed > best[-1][1]:
            best.append((time, speed))
    steps = [(time, speed) for time, speed in best]
    return Series("frontier", [t for t, _ in steps], [s for _, s in steps], "pale", "", line=True, width=3.0)
