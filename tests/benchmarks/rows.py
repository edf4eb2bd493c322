"""Figures as JSON, one row a line: a record is read, compared and counted by its lines."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any


def write_rows(path: Path, figures: dict[str, Any]) -> None:
    """Writes figures to a file, whose folder is made if it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(_lines(figures, 0)) + "\n", encoding="utf-8", newline="\n")


def _lines(value: Any, depth: int) -> list[str]:
    """Objects that hold rows, and the outermost object, are split over lines; all else takes one line."""
    if depth and not _has_rows(value):
        return [" " * depth + json.dumps(value)]
    is_object = isinstance(value, dict)
    parts = (
        [(f"{json.dumps(str(key))}: ", part) for key, part in value.items()] if is_object else [("", x) for x in value]
    )
    found = []
    for key, part in parts:
        lines = _lines(part, depth + 1)
        found += [" " * (depth + 1) + key + lines[0].lstrip(), *lines[1:]]
        found[-1] += ","
    if parts:
        found[-1] = found[-1][:-1]
    opening, closing = "{}" if is_object else "[]"
    return [" " * depth + opening, *found, " " * depth + closing]


def _has_rows(value: Any) -> bool:
    """Whether a list of objects is in it, at any depth."""
    if isinstance(value, dict):
        return any(map(_has_rows, value.values()))
    return isinstance(value, list | tuple) and any(isinstance(part, dict) or _has_rows(part) for part in value)
