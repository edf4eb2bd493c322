"""Pictures by matplotlib, which serves as a painter only: where everything goes is decided already."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from matplotlib.patheffects import withStroke
from PIL import Image

from .picture import HALO, Disc, Line, Picture, Shape, Text

POINTS = 72.0 / 100.0  # of one of our pixels, at 100 of them an inch


def write(picture: Picture, path: Path, zoom: float) -> None:
    """Writes a PNG without the date of its creation."""
    figure = Figure(figsize=(picture.width / 100.0, picture.height / 100.0), dpi=100.0 * zoom)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0, picture.width)
    axes.set_ylim(picture.height, 0)
    axes.axis("off")
    for order, mark in enumerate(picture.marks):
        artist = _artist(mark)
        artist.set_zorder(1.0 + 1e-3 * order)
        axes.add_artist(artist)
    for text in picture.texts:
        _write_words(axes, text)
    canvas.draw()
    pixels = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
    # Few colours are in it: a fifth of the bytes. Pillow writes no date.
    image = pixels.quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    path.parent.mkdir(parents=True, exist_ok=True)
    image.save(path, optimize=True)


def _artist(mark: Line | Shape | Disc) -> Line2D | Polygon | Circle:
    if isinstance(mark, Line):
        xs, ys = zip(*mark.points, strict=True)
        dashes = "solid" if mark.dashes is None else (0.0, tuple(length / mark.width for length in mark.dashes))
        joins = {"solid_joinstyle": "round", "solid_capstyle": "round"}
        return Line2D(xs, ys, color=mark.color, linewidth=mark.width * POINTS, linestyle=dashes, **joins)
    if isinstance(mark, Shape):
        return Polygon(list(mark.points), closed=True, color=mark.color, alpha=mark.opacity, linewidth=0)
    return Circle(mark.centre, mark.radius, color=mark.color, linewidth=0)


def _write_words(axes: object, text: Text) -> None:
    axes.text(  # type: ignore[attr-defined]
        *text.at,
        text.words,
        fontsize=text.size * POINTS,
        color=text.color,
        ha={"left": "left", "middle": "center", "right": "right"}[text.anchor],
        va="baseline",
        weight="bold" if text.bold else "normal",
        zorder=10.0,
        path_effects=[withStroke(linewidth=HALO * POINTS, foreground="#FFFFFF")],
    )
