"""(e) Bytes a triangle against M rays/s: what the layouts trade."""

from __future__ import annotations

from charts.figures import Figures, count, footer, load

from addon.bench.chart import EMBREE, OURS, Axis, Chart, Key, Panel, Series

DATA = "layouts"
KINDS = {"primary": "primary rays of a camera", "diffuse": "diffuse bounces"}
MARKS = {"default": "circle", "compact": "ring", "embree": "diamond", "embree_compact": "triangle"}
NAMES = {"default": "default", "compact": "compact", "embree": "Embree", "embree_compact": "Embree COMPACT"}


def chart(figures: Figures | None = None) -> Chart:
    """The picture's description; figures: of layouts.py."""
    figures = figures or load(DATA)
    return Chart(
        "The compact layout takes about half of the memory, and costs the more speed the larger the mesh",
        "All that is needed to trace, positions and triangles included, against speed on one thread: up and to the "
        "left is better. A thin line joins the two layouts of one mesh. Bars: quartiles of the rounds.",
        [_panel(figures, kind, title) for kind, title in KINDS.items()],
        footer(figures),
        panel_height=360,
        legend=(
            Key("Perfect BVH, default layout", OURS, "circle"),
            Key("compact layout", OURS, "ring"),
            Key("Embree 4.4", EMBREE, "diamond"),
            Key("Embree COMPACT", EMBREE, "triangle"),
        ),
    )


def _panel(figures: Figures, kind: str, title: str) -> Panel:
    series = []
    for mesh in figures["meshes"]:
        rows = {row["name"]: row for row in mesh["layouts"]}
        for pair, color in ((("default", "compact"), OURS), (("embree", "embree_compact"), EMBREE)):
            both = [rows[name] for name in pair]
            xs = [row["bytes_per_triangle"] for row in both]
            ys = [row["rays"][kind]["median"] for row in both]
            series.append(Series(mesh["name"], xs, ys, color, "", line=True, width=0.8))
            for name, row in zip(pair, both, strict=True):
                speed = row["rays"][kind]
                series.append(
                    Series(
                        mesh["name"],
                        [row["bytes_per_triangle"]],
                        [speed["median"]],
                        color,
                        MARKS[name],  # type: ignore[arg-type]
                        low=[speed["low"]],
                        high=[speed["high"]],
                        labels="points" if name in ("compact", "embree") else "",
                        names=[
                            f"{mesh['name']} {count(mesh['triangle_count'])}" if name == "compact" else mesh["name"]
                        ],
                        size=9.0,
                    )
                )
    return Panel(title, Axis("bytes a triangle"), Axis("million rays a second"), series)
