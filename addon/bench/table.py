"""What was measured, as the rows of a table: of each builder, layout and policy what it costs and what it gains."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from .advice import rays_per_second

Figures = dict[str, Any]
HEADINGS = {  # of what the rows of each part cost and gain
    "Builder": ("Build", "Rays"),
    "Layout": ("Memory", "Rays"),
    "Policy": ("Update", "Rays"),
    "Answers": ("Checked", "Wrong"),
}


@dataclass(frozen=True, slots=True)
class Row:
    """part: "Builder", "Layout", "Policy" or "Answers". cost, gain: numbers with their units, ready to be read."""

    part: str
    name: str
    cost: str
    gain: str


def table(figures: Figures) -> tuple[Row, ...]:
    """Of what has been measured so far: rows of one part stand together."""
    return (*_builders(figures), *_layouts(figures), *_policies(figures), *_answers(figures))


def format_table(rows: Sequence[Row]) -> str:
    """As lines of text, the columns below one another."""
    lines = []
    for part, group in groupby(rows, key=lambda row: row.part):
        lines += [(part, *HEADINGS[part]), *((f"  {row.name}", row.cost, row.gain) for row in group)]
    return "\n".join(f"{name:<12}{cost:>16}{gain:>18}" for name, cost, gain in lines)


def _builders(figures: Figures) -> Iterator[Row]:
    for row in figures.get("builders", ()):
        yield Row("Builder", row["name"], _time(row["build_ms"]["typical"]), _speed(rays_per_second(figures, row)))


def _layouts(figures: Figures) -> Iterator[Row]:
    for row in figures.get("layouts", ()):
        memory = f"{_three_digits(row['byte_count'] / 2**20)} MiB"
        yield Row("Layout", row["name"], memory, _speed(rays_per_second(figures, row)))


def _policies(figures: Figures) -> Iterator[Row]:
    """In the mean over the frames after the first, in which each policy builds all trees."""
    frames = figures.get("frames", ())[1:]
    for policy in frames[0]["policies"] if frames else ():
        rows = [row["policies"][policy] for row in frames]
        update = sum(row["update_ms"] for row in rows) / len(rows)
        rays, trace = sum(row["rays"] for row in frames), sum(row["trace_ms"] for row in rows)
        yield Row("Policy", policy, _time(update), _speed(rays / trace / 1e3))


def _answers(figures: Figures) -> Iterator[Row]:
    answers = figures.get("answers")
    if answers:
        yield Row("Answers", "audited", f"{answers['checked']:,}", f"{answers['wrong']:,}")


def _time(milliseconds: float) -> str:
    if milliseconds >= 1000.0:
        return f"{_three_digits(milliseconds / 1e3)} s"
    return f"{_three_digits(milliseconds)} ms"


def _speed(millions: float) -> str:
    return f"{_three_digits(millions)} M rays/s"


def _three_digits(value: float) -> str:
    """1,234, 123, 12.3, 1.23: never a power of ten."""
    return f"{value:,.0f}" if value >= 99.95 else f"{value:.1f}" if value >= 9.995 else f"{value:.2f}"
