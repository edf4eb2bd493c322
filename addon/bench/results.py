"""The files of a measurement: bench.json, a picture of each chart, and one of all together."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..support.files import replacing
from .layout import lay_out
from .picture import Disc, Line, Picture, Point, Shape
from .scene_charts import make_charts

JSON_NAME, OVERVIEW_NAME = "bench.json", "overview.png"


@dataclass(frozen=True, slots=True)
class Results:
    """advice: a sentence for each chart, by its name. pictures: of the charts. overview: all of them together."""

    json: Path
    advice: dict[str, str]
    pictures: tuple[Path, ...]
    overview: Path | None


def write(figures: dict[str, Any], folder: Path) -> Results:
    """The JSON first: where no picture can be drawn, DrawingError says so and the figures are kept. Errors: OSError.

    Each file is whole, or as it was before.
    """
    folder.mkdir(parents=True, exist_ok=True)
    charts = make_charts(figures)
    advice = {name: chart.title for name, chart in charts.items()}
    path = folder / JSON_NAME
    with replacing(path) as file:
        file.write_text(json.dumps({**figures, "advice": advice}, indent=1) + "\n", encoding="utf-8")
    pictures = {name: lay_out(chart) for name, chart in charts.items()}
    paths = []
    for name, picture in pictures.items():
        paths.append(folder / f"{name}.png")
        with replacing(paths[-1]) as file:
            picture.save(file)
    overview = None
    if pictures:
        overview = folder / OVERVIEW_NAME
        with replacing(overview) as file:
            one_above_another(list(pictures.values())).save(file)
    return Results(path, advice, tuple(paths), overview)


def one_above_another(pictures: list[Picture]) -> Picture:
    """One picture of all, as wide as the widest."""
    whole = Picture(max(picture.width for picture in pictures), sum(picture.height for picture in pictures))
    top = 0
    for picture in pictures:
        whole.marks += [_lowered(mark, top) for mark in picture.marks]
        whole.texts += [replace(text, at=_down(text.at, top)) for text in picture.texts]
        top += picture.height
    return whole


def _lowered(mark: Line | Shape | Disc, by: float) -> Line | Shape | Disc:
    if isinstance(mark, Disc):
        return replace(mark, centre=_down(mark.centre, by))
    return replace(mark, points=[_down(point, by) for point in mark.points])


def _down(point: Point, by: float) -> Point:
    return point[0], point[1] + by
