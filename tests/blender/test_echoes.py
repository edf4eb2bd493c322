"""Echoes of beams: they are merged and chosen as by a loop over single beams."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("bpy")

from perfect_bvh_addon.scanning.light.beams import are_detected, choose, merge, numbered
from perfect_bvh_addon.scanning.light.model import Detection


def arrivals(seed: int, count: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Arrivals of 60 beams in random order. Ranges are in tenths, so that many are equal; some beams return nothing."""
    random = np.random.default_rng(seed)
    energies = random.integers(0, 9, count) / 8.0
    return random.integers(0, 60, count), random.integers(10, 90, count) / 10.0, energies


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("resolution", [0.0, 0.15, 0.55, 10.0])
def test_echoes_are_runs_of_arrivals(seed: int, resolution: float) -> None:
    beams, ranges, energies = arrivals(seed)
    expected = []
    for beam in range(60):
        rows = sorted(np.flatnonzero((beams == beam) & (energies > 0.0)).tolist(), key=lambda row: ranges[row])
        runs: list[list[int]] = []
        for row in rows:
            if not runs or ranges[row] - ranges[runs[-1][-1]] > resolution:
                runs.append([])
            runs[-1].append(row)
        expected += [(beam, run) for run in runs]
    echoes = merge(beams, ranges, energies, resolution)
    assert echoes.beams.tolist() == [beam for beam, _ in expected]
    for row, (_, run) in enumerate(expected):
        assert echoes.energies[row] == pytest.approx(energies[run].sum(), rel=1e-14)
        assert echoes.ranges[row] == pytest.approx(np.average(ranges[run], weights=energies[run]), rel=1e-14)
        assert echoes.strongest[row] == max(run, key=lambda each: energies[each])
        assert echoes.are_single[row] == (len(run) == 1)


@pytest.mark.parametrize("rules", [("first",), ("last",), ("strongest", "last"), ("last", "first", "strongest")])
@pytest.mark.parametrize("most", [1, 2, 3, 15])
def test_rules_take_turns(rules: tuple[str, ...], most: int) -> None:
    beams, ranges, _ = arrivals(9)
    energies = np.random.default_rng(1).uniform(0.1, 1.0, len(beams))  # all are distinct
    echoes = merge(beams, ranges, energies, 0.0)
    expected = []
    for beam in range(60):
        left = np.flatnonzero(echoes.beams == beam).tolist()
        for turn in range(most):
            if left:
                keys = {"first": echoes.ranges, "last": -echoes.ranges, "strongest": -echoes.energies}
                expected.append(min(left, key=lambda row: keys[rules[turn % len(rules)]][row]))
                left.remove(expected[-1])
    kept = choose(echoes, rules, most)
    assert kept.tolist() == sorted(expected)
    return_ids, counts = numbered(echoes.beams[kept])
    for beam in range(60):
        of_beam = echoes.beams[kept] == beam
        assert return_ids[of_beam].tolist() == list(range(of_beam.sum()))
        assert set(counts[of_beam].tolist()) <= {int(of_beam.sum())}


def test_the_table_is_straight_between_its_entries() -> None:
    ranges = np.array([1.0, 10.0, 20.0, 30.0, 90.0])
    detection = Detection((10.0, 30.0), (0.1, 0.3))
    least = np.array([0.1, 0.1, 0.2, 0.3, 0.3])
    beams = np.arange(5)
    assert are_detected(merge(beams, ranges, least * (1 + 1e-12), 0.0), detection).all()
    assert not are_detected(merge(beams, ranges, least * (1 - 1e-12), 0.0), detection).any()
    assert len(merge(beams[:0], ranges[:0], least[:0], 0.0)) == 0
