"""What the zoo's table and chart say of losses is measured again, word by word and number by number."""

from __future__ import annotations

import pytest
from charts.figures import load
from makers.zoo import CASES, FailureCase

from stress.loss import WORK
from stress.losses import MEASURES, measure
from stress.zoo import row
from stress.zoo_table import DATA, TABLE, table

FIGURES = load(DATA)


def test_every_case_is_measured() -> None:
    assert list(MEASURES) and MEASURES.keys() == {case.name for case in CASES}
    assert [case["name"] for case in FIGURES["cases"]] == [case.name for case in CASES]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_usual_method_loses_and_ours_does_not(case: FailureCase) -> None:
    loss = measure(case)
    assert loss.naive > loss.nothing
    if loss.unit == WORK:
        assert loss.ours < loss.naive
    else:
        assert loss.ours == loss.nothing


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_kept_figures_are_those_of_this_engine(case: FailureCase) -> None:
    kept = next(each for each in FIGURES["cases"] if each["name"] == case.name)
    assert row(case) == kept, "python tests/stress/zoo.py --write"


def test_the_table_is_that_of_the_kept_figures() -> None:
    assert TABLE.read_text(encoding="utf-8") == table(FIGURES), "python tests/stress/zoo.py --write"
