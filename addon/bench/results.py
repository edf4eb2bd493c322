"""The results of a measurement: bench.json, the table and, where matplotlib is installed, charts as images."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from ..statistics.words import duration, rate
from ..support.files import reachable, replacing
from .advice import LABELS, POLICY_LABELS, Figures, advice, better_builder, rays_per_second

# The measurements, as the rows of a table: the cost and the gain of each builder and policy.


DIGITS = 3  # rows are compared with one another
HEADINGS = {  # of the cost and gain columns of each part
    "Builder": ("Build", "Rays"),
    "Updates": ("Time", "Rays"),
    "Results": ("Checked", "Wrong"),
}


@dataclass(frozen=True, slots=True)
class Row:
    """part: "Builder", "Updates" or "Results". cost, gain: numbers with their units, ready to be read.

    share: the gain in parts of the largest of this part; None where a bar of it would mean nothing.
    """

    part: str
    name: str
    cost: str
    gain: str
    share: float | None = None


def table(figures: Figures) -> tuple[Row, ...]:
    """Returns a table of the measurements so far: rows of one part are adjacent."""
    return (*_builder_rows(figures), *_policies(figures), *_answer_rows(figures))


def format_table(rows: Sequence[Row]) -> str:
    """Formats as lines of text with aligned columns."""
    lines = []
    for part, group in groupby(rows, key=lambda row: row.part):
        lines += [(part, *HEADINGS[part]), *((f"  {row.name}", row.cost, row.gain) for row in group)]
    return "\n".join(f"{name:<18}{cost:>12}{gain:>18}" for name, cost, gain in lines)


def _builder_rows(figures: Figures) -> Iterator[Row]:
    rows = figures.get("builders", ())
    speeds = [rays_per_second(figures, row) for row in rows]
    for row, speed in zip(rows, speeds, strict=True):
        cost = duration(row["build_ms"]["typical"], DIGITS)
        yield Row("Builder", LABELS[row["name"]], cost, _speed(speed), speed / max(speeds))


def _policies(figures: Figures) -> Iterator[Row]:
    """Averages over the frames after the first, in which each policy builds all trees."""
    frames = figures.get("frames", ())[1:]
    rays = sum(row["rays"] for row in frames)
    rows_of = {
        policy: [row["policies"][policy] for row in frames] for policy in (frames[0]["policies"] if frames else ())
    }
    speeds = {policy: rays / sum(row["trace_ms"] for row in rows) / 1e3 for policy, rows in rows_of.items()}
    for policy, rows in rows_of.items():
        update = duration(sum(row["update_ms"] for row in rows) / len(rows), DIGITS)
        share = speeds[policy] / max(speeds.values())
        yield Row("Updates", POLICY_LABELS[policy], update, _speed(speeds[policy]), share)


def _answer_rows(figures: Figures) -> Iterator[Row]:
    answers = figures.get("answers")
    if answers:
        yield Row("Results", "Sample", f"{answers['checked']:,}", f"{answers['wrong']:,}")


def _speed(millions: float) -> str:
    return rate(1e6 * millions, DIGITS)


# Results -------------------------------------------------------------------------------------------------------------


JSON_NAME, OVERVIEW_NAME = "bench.json", "overview.png"
HOW_TO_GET_CHARTS = "matplotlib is not installed, so no charts are drawn: pip install 'perfect-bvh[bench]'"


@dataclass(frozen=True, slots=True)
class Results:
    """advice: a sentence for each part, by its name. pictures: of the parts that have a chart, by its name.

    overview: all charts in one image. can_draw: whether matplotlib is available; if not, there are no pictures.
    better: the builder, as `BuildConfig` names it, that is advised instead of Automatic; None if none is.
    """

    json: Path
    table: tuple[Row, ...]
    advice: dict[str, str]
    pictures: dict[str, Path]
    overview: Path | None
    can_draw: bool
    better: str | None = None


_last: dict[int, Results] = {}  # by the scene's session uid, which no other scene gets while Blender runs


def write(figures: dict[str, Any], folder: Path) -> Results:
    """Writes everything, the JSON first. Each file is replaced as a whole or not at all. Errors: OSError."""
    reachable(folder).mkdir(parents=True, exist_ok=True)
    sentences = advice(figures)
    path, better = folder / JSON_NAME, better_builder(figures)
    with replacing(path) as file:
        file.write_text(json.dumps({**figures, "advice": sentences}, indent=1) + "\n", encoding="utf-8")
    try:
        from . import charts
    except ImportError:
        return Results(path, table(figures), sentences, {}, None, can_draw=False, better=better)
    figure_of = charts.draw(figures, sentences)
    pictures = {name: folder / f"{name}.png" for name in figure_of}
    for name, picture in pictures.items():
        with replacing(picture) as file:
            charts.save(figure_of[name], file)
    overview = folder / OVERVIEW_NAME if pictures else None
    if overview is not None:
        with replacing(overview) as file:
            charts.save(charts.draw_overview(figures, sentences), file)
    return Results(path, table(figures), sentences, pictures, overview, can_draw=True, better=better)


def remember(session_uid: int, results: Results) -> None:
    """Stores the results that the panel shows of this scene from now on."""
    _last[session_uid] = results


def last_results(session_uid: int) -> Results | None:
    """Returns the last measurement of this scene, None if there was none since Blender was started."""
    return _last.get(session_uid)


def forget() -> None:
    """Drops all results."""
    _last.clear()
