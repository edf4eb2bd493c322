"""What was measured, as the rows of a table: of each builder and policy what it costs and what it gains."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from ..statistics.words import duration, rate
from .advice import rays_per_second

Figures = dict[str, Any]
DIGITS = 3  # rows are compared with one another
HEADINGS = {  # of what the rows of each part cost and gain
    "Builder": ("Build", "Rays"),
    "Policy": ("Update", "Rays"),
    "Answers": ("Checked", "Wrong"),
}


@dataclass(frozen=True, slots=True)
class Row:
    """part: "Builder", "Policy" or "Answers". cost, gain: numbers with their units, ready to be read."""

    part: str
    name: str
    cost: str
    gain: str


def table(figures: Figures) -> tuple[Row, ...]:
    """Of what has been measured so far: rows of one part stand together."""
    return (*_builders(figures), *_policies(figures), *_answers(figures))


def format_table(rows: Sequence[Row]) -> str:
    """As lines of text, the columns below one another."""
    lines = []
    for part, group in groupby(rows, key=lambda row: row.part):
        lines += [(part, *HEADINGS[part]), *((f"  {row.name}", row.cost, row.gain) for row in group)]
    return "\n".join(f"{name:<12}{cost:>16}{gain:>18}" for name, cost, gain in lines)


def _builders(figures: Figures) -> Iterator[Row]:
    for row in figures.get("builders", ()):
        yield Row(
            "Builder", row["name"], duration(row["build_ms"]["typical"], DIGITS), _speed(rays_per_second(figures, row))
        )


def _policies(figures: Figures) -> Iterator[Row]:
    """In the mean over the frames after the first, in which each policy builds all trees."""
    frames = figures.get("frames", ())[1:]
    for policy in frames[0]["policies"] if frames else ():
        rows = [row["policies"][policy] for row in frames]
        update = sum(row["update_ms"] for row in rows) / len(rows)
        rays, trace = sum(row["rays"] for row in frames), sum(row["trace_ms"] for row in rows)
        yield Row("Policy", policy, duration(update, DIGITS), _speed(rays / trace / 1e3))


def _answers(figures: Figures) -> Iterator[Row]:
    answers = figures.get("answers")
    if answers:
        yield Row("Answers", "audited", f"{answers['checked']:,}", f"{answers['wrong']:,}")


def _speed(millions: float) -> str:
    return rate(1e6 * millions, DIGITS)
