"""The results of a measurement: bench.json, the table and, where matplotlib is installed, charts as images."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..support.files import replacing
from ..support.paths import reachable
from .advice import advice
from .table import Row, table

JSON_NAME, OVERVIEW_NAME = "bench.json", "overview.png"
HOW_TO_GET_CHARTS = "matplotlib is not installed, so no charts are drawn: pip install 'perfect-bvh[bench]'"


@dataclass(frozen=True, slots=True)
class Results:
    """advice: a sentence for each part, by its name. pictures: of the parts that a chart tells more of, by its name.

    overview: all charts in one image. can_draw: whether matplotlib is there; if not, there are no pictures.
    """

    json: Path
    table: tuple[Row, ...]
    advice: dict[str, str]
    pictures: dict[str, Path]
    overview: Path | None
    can_draw: bool


_last: dict[int, Results] = {}  # by the scene's session uid, which no other scene gets while Blender runs


def write(figures: dict[str, Any], folder: Path) -> Results:
    """All of it, the JSON first. Each file is whole, or as it was before. Errors: OSError."""
    reachable(folder).mkdir(parents=True, exist_ok=True)
    sentences = advice(figures)
    path = folder / JSON_NAME
    with replacing(path) as file:
        file.write_text(json.dumps({**figures, "advice": sentences}, indent=1) + "\n", encoding="utf-8")
    try:
        from . import charts
    except ImportError:
        return Results(path, table(figures), sentences, {}, None, can_draw=False)
    figure_of = charts.draw(figures, sentences)
    pictures = {name: folder / f"{name}.png" for name in figure_of}
    for name, picture in pictures.items():
        with replacing(picture) as file:
            charts.save(figure_of[name], file)
    overview = folder / OVERVIEW_NAME if pictures else None
    if overview is not None:
        with replacing(overview) as file:
            charts.save(charts.draw_overview(figures, sentences), file)
    return Results(path, table(figures), sentences, pictures, overview, can_draw=True)


def remember(session_uid: int, results: Results) -> None:
    """What the panel shows of this scene from now on."""
    _last[session_uid] = results


def last_results(session_uid: int) -> Results | None:
    """Of the last measurement of this scene, None if there was none since Blender was started."""
    return _last.get(session_uid)


def forget() -> None:
    """All of it."""
    _last.clear()
