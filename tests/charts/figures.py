"""Reads the figures that benchmarks wrote for the charts, and words the machine and command for their footers."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parent
DATA, PICTURES = FOLDER / "data", FOLDER / "pictures"
Figures = dict[str, Any]


def load(name: str, folder: Path = DATA) -> Figures:
    """The figures of data/NAME.json."""
    figures: Figures = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    return figures


def footer(figures: Figures) -> str:
    """The machine that the figures were measured on, and the command."""
    machine = figures["machine"]
    versions = ", ".join(
        f"{label} {machine['versions'][key]}"
        for key, label in (("embreex", "embreex"), ("bpy", "Blender"))
        if machine["versions"].get(key)
    )
    processor = " ".join(re.sub(r"\s+|\(R\)|\(TM\)", " ", machine["processor"]).split())
    sizes = "".join(f", {level} {size}" for level, size in machine.get("caches", {}).items())
    threads = f"{machine['threads']} thread{'s' if machine['threads'] > 1 else ''}"
    load = ", ".join(f"{average:.1f}" for average in machine["load_average"])
    return (
        f"{processor}{sizes}, {threads}, {machine['isa']}; commit {machine['commit']}; {versions}. "
        f"Load averages at the end, of 1, 5 and 15 minutes: {load}. Measured by: {' '.join(machine['command'])}"
    )


def rounds_of(meshes: list[Figures]) -> str:
    """How many rounds the quartiles are based on: "2 to 3 rounds"."""
    counts = sorted({tree["round_count"] for mesh in meshes for tree in mesh["trees"]})
    return f"{counts[0]} to {counts[-1]} rounds" if len(counts) > 1 else f"{counts[0]} rounds"


def only(rows: list[Figures], name: str) -> Figures:
    """The row of that name."""
    return next(row for row in rows if row["name"] == name)


def named(rows: list[Figures]) -> dict[str, Figures]:
    return {row["name"]: row for row in rows}


def geometric_mean(values: list[float]) -> float:
    return math.exp(sum(math.log(value) for value in values) / len(values))


def count(number: float) -> str:
    """262 thousand, 1.1 million, 1 billion."""
    if number >= 1e9:
        return f"{number / 1e9:.2g} billion"
    if number >= 1e6:
        return f"{number / 1e6:.2g} million"
    return f"{number / 1e3:.0f} thousand" if number >= 1e4 else f"{number:,.0f}"
