"""(e) Bytes a triangle against M rays/s: what the layouts trade."""

from __future__ import annotations

from charts.chart import EMBREE, OURS, Axis, Chart, Key, Labels, Mark, Panel, Series
from charts.figures import Figures, count, footer, load

DATA = "layouts"
MESHES = ("courtyard", "sponza", "dragon", "dragon x16")  # or whatever was measured
KINDS = ("primary", "diffuse")
MARKS: dict[str, Mark] = {"default": "circle", "compact": "ring", "embree": "diamond", "embree_compact": "triangle"}


def chart(figures: Figures | None = None) -> Chart:
    """The picture's description; figures: of layouts.py."""
    figures = figures or load(DATA)
    chosen = [mesh for mesh in figures["meshes"] if mesh["name"] in MESHES] or figures["meshes"]
    chosen = sorted(chosen, key=lambda mesh: mesh["triangle_count"])
    return Chart(
        "The compact layout takes about half of the memory; diffuse rays lose the more speed the larger the mesh",
        "All that is needed to trace, positions and triangles included, against speed on one thread, of primary rays "
        "and diffuse bounces: up and to the left is better. Lines join the two layouts. Bars: quartiles.",
        [_panel(mesh) for mesh in chosen],
        footer(figures),
        panel_height=270,
        legend=(
            Key("Perfect BVH, default layout", OURS, "circle"),
            Key("compact layout", OURS, "ring"),
            Key("Embree 4.4", EMBREE, "diamond"),
            Key("Embree COMPACT", EMBREE, "triangle"),
        ),
    )


def _panel(mesh: Figures) -> Panel:
    rows = {row["name"]: row for row in mesh["layouts"]}
    series = []
    for pair, color in ((("default", "compact"), OURS), (("embree", "embree_compact"), EMBREE)):
        for kind in KINDS:
            both = [rows[name] for name in pair]
            xs = [row["bytes_per_triangle"] for row in both]
            series.append(
                Series(kind, xs, [row["rays"][kind]["median"] for row in both], color, "", line=True, width=1.0)
            )
            for name, row in zip(pair, both, strict=True):
                series.append(_point(kind, row, color, MARKS[name], is_named=name in ("default", "embree")))
    title = f"{mesh['name']}: {count(mesh['triangle_count'])} triangles"
    return Panel(title, Axis("bytes a triangle"), Axis("million rays a second"), series)


def _point(kind: str, row: Figures, color: str, mark: Mark, *, is_named: bool) -> Series:
    speed = row["rays"][kind]
    low, high = [speed["low"]], [speed["high"]]
    labels: Labels = "first" if is_named else ""
    xs = [row["bytes_per_triangle"]]
    return Series(kind, xs, [speed["median"]], color, mark, low=low, high=high, labels=labels, size=9.0)
