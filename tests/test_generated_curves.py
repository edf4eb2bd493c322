"""Curves and points for measurements: of the numbers and kinds that they are said to be of, the same each time."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks import generated_curves
from benchmarks.generated_curves import BenchBalls


def check(balls: BenchBalls) -> None:
    assert balls.points.dtype == balls.radii.dtype == np.float32
    assert balls.points.shape == (len(balls.radii), 3)
    assert np.isfinite(balls.points).all() and np.isfinite(balls.radii).all()
    assert (balls.radii >= 0.0).all() and (balls.radii > 0.0).any()
    if balls.offsets is not None:
        assert balls.offsets[0] == 0 and balls.offsets[-1] == len(balls.points)
        assert (np.diff(balls.offsets) >= 2).all()


def test_they_are_what_they_are_called() -> None:
    made = {balls.name: balls for balls in generated_curves.make_all(0.01)}
    assert list(made) == ["lawn", "fur", "long hair", "scan"]
    assert {name: balls.primitive_count for name, balls in made.items()} == {
        "lawn": 2000 * 4,
        "fur": 1000 * 8,
        "long hair": 200 * 64,
        "scan": 10_000,
    }
    again = {balls.name: balls for balls in generated_curves.make_all(0.01)}
    for name, balls in made.items():
        check(balls)
        assert np.array_equal(balls.points, again[name].points)


def test_strands_are_long_and_thin() -> None:
    for balls in generated_curves.make_all(0.01)[:3]:
        assert balls.offsets is not None
        steps = np.linalg.norm(np.diff(balls.points, axis=0), axis=1)
        is_segment = np.ones(len(steps), bool)
        is_segment[balls.offsets[1:-1] - 1] = False
        assert np.median(steps[is_segment] / np.maximum(balls.radii[:-1][is_segment], 1e-6)) > 8.0
        assert steps[is_segment].min() > 0.0


@pytest.mark.parametrize("balls", generated_curves.make_hard(), ids=lambda balls: balls.name)
def test_hard_ones_are_well_formed(balls: BenchBalls) -> None:
    check(balls)
    assert 100 <= balls.primitive_count <= 5000


@pytest.mark.parametrize("balls", generated_curves.make_all(0.001), ids=lambda balls: balls.name)
def test_wind_moves_tips_and_no_roots(balls: BenchBalls) -> None:
    moved = generated_curves.blown(balls, 3)
    check(moved)
    shift = np.linalg.norm(moved.points - balls.points, axis=1)
    assert shift.max() > 0.0
    if balls.offsets is not None:
        assert not shift[balls.offsets[:-1]].any()
    assert not np.array_equal(moved.points, generated_curves.blown(balls, 4).points)
