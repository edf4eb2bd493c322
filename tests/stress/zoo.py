"""Measures the losses of usual methods and of this engine on the failure cases: a minute of counting.

python tests/stress/zoo.py --write           writes tests/charts/data/zoo.json and, from that, tests/stress/ZOO.md
python tests/stress/zoo.py --json OUT.json   writes the figures elsewhere
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    TESTS = Path(__file__).resolve().parent.parent
    sys.path[:0] = [str(TESTS), str(TESTS.parent / "blend_scenes")]

from benchmarks.machine import describe
from benchmarks.rows import write_rows
from charts.measure import keep
from makers.zoo import CASES, FailureCase

from stress.losses import MEASURES, measure
from stress.losses_of_rounds import round_rows
from stress.losses_of_times import time_rows
from stress.zoo_table import write_table


def row(case: FailureCase) -> dict[str, Any]:
    """One case: its words, and the losses on it, measured now."""
    words = {name: getattr(case, name) for name in ("name", "title", "breaks", "source", "held")}
    return {**words, "method": MEASURES[case.name].method, **measure(case).as_json()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--write", action="store_true", help="bring the repository's figures and table up to date")
    where.add_argument("--json", type=Path, metavar="OUT.json", help="where the figures go")
    chosen = parser.parse_args()
    figures = {"machine": describe(), "cases": [row(case) for case in CASES]}
    figures |= {"round_cases": round_rows(), "time_cases": time_rows()}
    if chosen.write:
        keep("zoo", figures)
        write_table()
    else:
        write_rows(chosen.json, figures)


if __name__ == "__main__":
    main()
