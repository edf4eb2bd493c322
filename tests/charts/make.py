"""Draws the charts from the figures in data/, all or those that are named: python tests/charts/make.py [NAME ...].

Needs matplotlib and numpy, not the engine: `nox -s charts` brings them. Each picture carries a fingerprint of its
content, so that a test can detect a picture that does not match the figures. ZOO.md is rewritten with the zoo's chart,
and README.md gets the sentences that told.py makes of the figures.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(REPOSITORY), str(REPOSITORY / "tests")]

from charts import told
from charts.chart import Chart
from charts.figures import DATA, PICTURES
from charts.layout import lay_out
from stress import zoo_table

CHARTS = (
    "build_and_speed",
    "break_even",
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


def fingerprint(chart: Chart) -> str:
    """Hashes every word and every number of a chart, to six digits, independent of the layout."""
    return hashlib.sha256("\n".join(_parts(chart)).encode()).hexdigest()


def _parts(value: object) -> Iterator[str]:
    if dataclasses.is_dataclass(value):
        for each in dataclasses.fields(value):
            yield f"{each.name}:"
            yield from _parts(getattr(value, each.name))
    elif isinstance(value, Sequence) and not isinstance(value, str):
        yield f"{len(value)}:"
        for item in value:
            yield from _parts(item)
    else:
        yield f"{float(value):.6g}" if isinstance(value, int | float) else repr(value)


def draw(name: str) -> Path:
    """Draws a chart and writes the fingerprint of its content into the picture."""
    from PIL import Image, PngImagePlugin  # matplotlib brings it

    chart, path = describe(name), PICTURES / f"{name}.png"
    lay_out(chart).save(path)
    words = PngImagePlugin.PngInfo()
    words.add_text("drawn from", fingerprint(chart))
    with Image.open(path) as picture:
        picture.load()
        picture.save(path, pnginfo=words, optimize=True)
    return path


def main() -> None:
    names = sys.argv[1:] or CHARTS
    unknown = sorted(set(names) - set(CHARTS))
    if unknown:
        raise SystemExit(f"no chart is called {', '.join(unknown)}; they are {', '.join(CHARTS)}")
    for name in names:
        needed = importlib.import_module(f"charts.{name}").DATA
        if not (DATA / f"{needed}.json").is_file():
            raise SystemExit(f"{name}: data/{needed}.json is missing; nox -s charts -- --measure {needed} makes it")
        print(draw(name))
        if needed == zoo_table.DATA:
            zoo_table.write_table()
    told.README.write_text(told.retold(told.README.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
