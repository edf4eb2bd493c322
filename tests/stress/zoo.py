"""The table of what usual methods lose on the failure cases, and what this engine loses there.

python tests/stress/zoo.py            prints it
python tests/stress/zoo.py --write    writes tests/stress/ZOO.md
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import perfect_bvh
from perfect_bvh_addon.failure_cases import CASES, FailureCase

from stress.losses import MEASURES, measure

TABLE = Path(__file__).parent / "ZOO.md"

OPENING = """\
# The failure zoo

Written by `python tests/stress/zoo.py --write`; a test checks that it has every case and every word. Each case is a
small seeded scene on which a usual method fails, made by [`addon/failure_cases/`](../../addon/failure_cases/);
the panel *Failure Cases* makes it in Blender, and twelve of them are files in `blend_scenes/zoo/`.
`tests/stress/test_zoo.py` checks the answers on all of them against double precision, with every builder, on every
instruction set, in every way of tracing.

What is lost is counted, never timed. *Times the work*: boxes and triangles that the same rays test, relative to the
best tree known, so that 1.00 is no loss; after an edit, relative to a fresh tree of the same kind. *Wrong per million*:
answers that the audit in double precision, which knows no tree, finds wrong. The usual methods are those in
[`tests/stress/naive/`](naive/), or this engine's own `median` and `sweep` builders. Ours is what the engine does unless
asked otherwise; what it does when asked stands beside it in brackets. Numbers are those of the instruction set {isa}.

| case | what breaks | seen in | the usual method | loses | ours loses | how it is held |
|---|---|---|---|---|---|---|
"""


def row(case: FailureCase) -> str:
    """One line of the table, measured now."""
    loss = measure(case)
    ours = loss.shown(loss.ours)
    if loss.other is not None:
        ours += f" (`{loss.other[0]}`: {loss.shown(loss.other[1])})"
    naive = f"{loss.shown(loss.naive)} {loss.unit}"
    cells = (case.title, case.breaks, case.source, MEASURES[case.name].method, naive, ours, case.held)
    return f"| {' | '.join(cells)} |\n"


def table() -> str:
    """The whole file."""
    return OPENING.format(isa=perfect_bvh.active_isa()) + "".join(map(row, CASES))


def without_numbers(text: str) -> str:
    """The words alone: numbers differ between instruction sets, and when the engine gets better."""
    return re.sub(r"\d[\d,.]*", "#", re.sub(r" \(`[^`]*`: [\d,.]+\)", "", text))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help=f"write {TABLE.name} instead of printing it")
    text = table()
    if parser.parse_args().write:
        TABLE.write_text(text, encoding="utf-8")
    else:
        print(text)


if __name__ == "__main__":
    main()
