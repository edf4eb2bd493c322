"""Plain tables for the console."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

Cell = str | float | int | None


def cell(value: Cell, digits: int = 2) -> str:
    """A number with this number of digits after the point, a dash if it was not measured."""
    if value is None:
        return "-"
    return f"{value:,.{digits}f}" if isinstance(value, float) else f"{value:,}" if isinstance(value, int) else value


def format_table(heads: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    """The first column to the left, the others to the right."""
    lines = [list(heads), *([cell(value) for value in row] for row in rows)]
    widths = [max(len(line[column]) for line in lines) for column in range(len(heads))]
    texts = []
    for line in lines:
        first, *rest = (text.rjust(width) for text, width in zip(line, widths, strict=True))
        texts.append("  ".join([line[0].ljust(len(first)), *rest]).rstrip())
    texts.insert(1, "-" * sum(widths, 2 * (len(widths) - 1)))
    return "\n".join(texts)


def format_goals(goals: Iterable[Mapping[str, Any]]) -> str:
    """Goals and figures reached. goals: rows of goal, measured, wanted, most (whether that is a limit), where."""
    lines: list[list[Cell]] = [
        [
            goal["goal"],
            goal["measured"],
            f"{'<=' if goal['most'] else '>='} {goal['wanted']:.2f}",
            "yes" if goal["reached"] else "no",
            goal["where"],
        ]
        for goal in goals
    ]
    return format_table(("goal", "measured", "wanted", "reached", "where"), lines)
