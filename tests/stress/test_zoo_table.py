"""Measures the losses in the zoo's table and chart again, and compares every word and number."""

from __future__ import annotations

import pytest
from charts.figures import load
from makers.zoo import CASES, FailureCase

from stress.loss import WORK, Loss
from stress.losses import MEASURES, measure
from stress.losses_of_rounds import ROUND_MEASURES, measure_round, round_row
from stress.losses_of_times import TIME_MEASURES, measure_time, time_row
from stress.round_zoo import ROUND_CASES, RoundCase
from stress.time_zoo import TIME_CASES, TimeCase
from stress.zoo import row
from stress.zoo_table import DATA, TABLE, table

FIGURES = load(DATA)


def test_every_case_is_measured() -> None:
    assert list(MEASURES) and MEASURES.keys() == {case.name for case in CASES}
    assert [case["name"] for case in FIGURES["cases"]] == [case.name for case in CASES]
    assert [case["name"] for case in FIGURES["round_cases"]] == [case.name for case in ROUND_CASES] == [*ROUND_MEASURES]
    assert [case["name"] for case in FIGURES["time_cases"]] == [case.name for case in TIME_CASES] == [*TIME_MEASURES]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_usual_method_loses_and_ours_does_not(case: FailureCase) -> None:
    check_loss(measure(case))


@pytest.mark.parametrize("case", ROUND_CASES, ids=lambda case: case.name)
def test_the_usual_method_loses_on_curves_and_points_and_ours_does_not(case: RoundCase) -> None:
    check_loss(measure_round(case))


@pytest.mark.parametrize("case", TIME_CASES, ids=lambda case: case.name)
def test_the_usual_method_loses_on_what_moves_and_ours_does_not(case: TimeCase) -> None:
    check_loss(measure_time(case))


def check_loss(loss: Loss) -> None:
    assert loss.naive > loss.nothing
    if loss.unit == WORK:
        assert loss.ours < loss.naive
    else:
        assert loss.ours == loss.nothing


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_kept_figures_are_those_of_this_engine(case: FailureCase) -> None:
    kept = next(each for each in FIGURES["cases"] if each["name"] == case.name)
    assert row(case) == kept, "python tests/stress/zoo.py --write"


@pytest.mark.parametrize("case", ROUND_CASES, ids=lambda case: case.name)
def test_the_kept_figures_of_curves_and_points_are_those_of_this_engine(case: RoundCase) -> None:
    """Except for the losses of float32 formulas: numpy rounds their sums in another order on other processors."""
    kept = next(each for each in FIGURES["round_cases"] if each["name"] == case.name)
    found = round_row(case)
    assert found["naive"] == pytest.approx(kept["naive"], rel=0.2), "python tests/stress/zoo.py --write"
    assert found | {"naive": kept["naive"]} == kept, "python tests/stress/zoo.py --write"
    assert kept["as_triangles"] > 0


@pytest.mark.parametrize("case", TIME_CASES, ids=lambda case: case.name)
def test_the_kept_figures_of_what_moves_are_those_of_this_engine(case: TimeCase) -> None:
    kept = next(each for each in FIGURES["time_cases"] if each["name"] == case.name)
    assert time_row(case) == kept, "python tests/stress/zoo.py --write"


def test_the_table_is_that_of_the_kept_figures() -> None:
    assert TABLE.read_text(encoding="utf-8") == table(FIGURES), "python tests/stress/zoo.py --write"
