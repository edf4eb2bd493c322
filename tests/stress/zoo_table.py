"""Makes the table ZOO.md from the zoo's figures. Needs neither the engine nor Blender."""

from __future__ import annotations

from pathlib import Path

from charts.figures import Figures, load

from .loss import WORK

DATA = "zoo"
TABLE = Path(__file__).parent / "ZOO.md"

OPENING = """\
# The failure zoo

Written by `python tests/stress/zoo.py --write` from figures that it measures into
[`tests/charts/data/zoo.json`](../charts/data/zoo.json), and drawn as a [chart](../charts/README.md#the-failure-zoo); a
test measures every figure again. Each of the {count} cases is a small seeded scene on which a usual method fails, made
by [`blend_scenes/makers/zoo/`](../../blend_scenes/makers/zoo/), and a file in
[`blend_scenes/zoo/`](../../blend_scenes/zoo/), which opens on what fails and begins with what to do.
`tests/stress/test_zoo.py` checks the answers on all of them against double precision, with every builder, on
every instruction set, in every way of tracing.

What is lost is counted, never timed. *Times the work*: boxes and triangles that the same rays test, relative to the
best tree known, so that 1.00 is no loss; after an edit, relative to a fresh tree of the same kind. *Wrong per million*:
answers that the audit in double precision, which knows no tree, finds wrong. The usual methods are those in
[`tests/stress/naive/`](naive/), or this engine's own `median` and `sweep` builders. Ours is what the engine does unless
asked otherwise; what it does when asked stands beside it in brackets. All of it is the same on every instruction set.

| case | what breaks | seen in | the usual method | loses | ours loses | how it is held |
|---|---|---|---|---|---|---|
"""

ROUND_OPENING = """
## Curves and points

The {count} shapes of [`tests/stress/round_zoo.py`](round_zoo.py), which have no files. `tests/stress/test_round_zoo.py`
checks the answers on all of them against a double-precision oracle of round curves and balls, with every builder, on
every instruction set, in every way of tracing. *As triangles*: of a million rays, those that meet another curve or
point, or hit where the true surface is missed or the other way round, if tubes of six sides (of points octahedra)
stand for it; ours are the true surface's, as the reference finds.

| case | what breaks | the usual method | loses | ours loses | as triangles | how it is held |
|---|---|---|---|---|---|---|
"""

TIME_OPENING = """
## In time

The {count} motions of [`tests/stress/time_zoo.py`](time_zoo.py), which have no files; rays at times within the shutter.
`tests/stress/test_time_zoo.py` compares the answers with formulas of their own, on every instruction set.

| case | what breaks | seen in | the usual method | loses | ours loses | how it is held |
|---|---|---|---|---|---|---|
"""


def shown(value: float, unit: str) -> str:
    """The number as the table has it."""
    return f"{value:.2f}" if unit == WORK else f"{value:,.0f}"


def line_of(case: Figures) -> str:
    """One line of the table."""
    title = f"[{case['title']}](../../blend_scenes/zoo/{case['name']}.blend)"
    return _line(title, case["breaks"], case["source"], case["method"], *_losses(case), case["held"])


def round_line_of(case: Figures) -> str:
    """One line of the table of curves and points."""
    triangles = f"{case['as_triangles']:,} unlike per million"
    return _line(case["title"], case["breaks"], case["method"], *_losses(case), triangles, case["held"])


def time_line_of(case: Figures) -> str:
    """One line of the table of motions."""
    return _line(case["title"], case["breaks"], case["source"], case["method"], *_losses(case), case["held"])


def _losses(case: Figures) -> tuple[str, str]:
    """The losses of the usual method and of this engine."""
    unit = case["unit"]
    ours = shown(case["ours"], unit)
    if case["other"] is not None:
        asked, value = case["other"]
        ours += f" (`{asked}`: {shown(value, unit)})"
    return f"{shown(case['naive'], unit)} {unit}", ours


def _line(*cells: str) -> str:
    return f"| {' | '.join(cells)} |\n"


def table(figures: Figures) -> str:
    """The whole file."""
    cases, rounds, times = figures["cases"], figures["round_cases"], figures["time_cases"]
    text = OPENING.format(count=len(cases)) + "".join(map(line_of, cases))
    text += ROUND_OPENING.format(count=len(rounds)) + "".join(map(round_line_of, rounds))
    return text + TIME_OPENING.format(count=len(times)) + "".join(map(time_line_of, times))


def write_table() -> None:
    """Rewrites ZOO.md from the figures that are kept."""
    TABLE.write_text(table(load(DATA)), encoding="utf-8")
