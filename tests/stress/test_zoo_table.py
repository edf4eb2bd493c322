"""ZOO.md has every case and every word of it, and what it says of losses is so."""

from __future__ import annotations

import pytest
from perfect_bvh_addon.failure_cases import CASES, FailureCase

from stress.loss import WORK
from stress.losses import MEASURES, measure
from stress.zoo import OPENING, TABLE, row, without_numbers


def test_every_case_is_measured() -> None:
    assert list(MEASURES) and MEASURES.keys() == {case.name for case in CASES}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_usual_method_loses_and_ours_does_not(case: FailureCase) -> None:
    loss = measure(case)
    assert loss.naive > loss.nothing
    if loss.unit == WORK:
        assert loss.ours < loss.naive
    elif case.name == "grazed_slivers":  # rounding moves rays from one sliver to another; none is wrong beyond that
        assert loss.ours < loss.naive / 5
    else:
        assert loss.ours == loss.nothing


def test_the_table_has_these_words() -> None:
    """Not these numbers: they are another instruction set's, or an older engine's."""
    rows = TABLE.read_text(encoding="utf-8").splitlines()[-len(CASES) :]
    for line, case in zip(rows, CASES, strict=True):
        assert without_numbers(line) == without_numbers(row(case)).rstrip("\n")
    assert TABLE.read_text(encoding="utf-8").startswith(OPENING.split("{isa}")[0])
