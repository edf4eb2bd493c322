"""Draws the charts from what stands in data/, all or those that are named: python tests/charts/make.py [NAME ...].

Needs matplotlib and numpy, not the engine: `nox -s charts` brings them.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(REPOSITORY), str(REPOSITORY / "tests")]

from charts.figures import DATA, PICTURES

from addon.bench.chart import Chart
from addon.bench.layout import lay_out

CHARTS = (
    "build_and_speed",
    "break_even",
    "memory_and_speed",
    "predicted_cost",
    "wrong_answers",
    "image_error",
    "stability",
    "policies_by_frame",
    "failure_zoo",
)


def describe(name: str) -> Chart:
    """The chart of one of the modules, from its figures."""
    chart: Chart = importlib.import_module(f"charts.{name}").chart()
    return chart


def main() -> None:
    names = sys.argv[1:] or CHARTS
    unknown = sorted(set(names) - set(CHARTS))
    if unknown:
        raise SystemExit(f"no chart is called {', '.join(unknown)}; they are {', '.join(CHARTS)}")
    for name in names:
        needed = importlib.import_module(f"charts.{name}").DATA
        if not (DATA / f"{needed}.json").is_file():
            raise SystemExit(f"{name}: data/{needed}.json is missing; nox -s charts -- --measure {needed} makes it")
        lay_out(describe(name)).save(PICTURES / f"{name}.png")
        print(PICTURES / f"{name}.png")


if __name__ == "__main__":
    main()
