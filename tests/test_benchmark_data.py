"""The calculations on paper of the benchmark of data sets."""

from __future__ import annotations

import pytest
from benchmarks.farm_on_paper import DISK_MEGABYTES, Farm, saturations


def test_whoever_is_busy_first_is_what_a_larger_farm_waits_for():
    found = saturations(
        Farm(piece_seconds=2.0, piece_megabytes=40.0, task_microseconds=2000.0, scene_megabytes=0.5), 100
    )
    assert found["first"] == "disk"
    assert found["saturated_by_workers"] == pytest.approx({"scheduler": 1000.0, "disk": DISK_MEGABYTES / 20.0})
    assert found["busy"] == pytest.approx({"scheduler": 0.1, "disk": 2000.0 / DISK_MEGABYTES})
    assert found["start_seconds_scene"] == pytest.approx(50.0 / DISK_MEGABYTES)


def test_small_pieces_keep_the_scheduler_busiest():
    found = saturations(Farm(piece_seconds=0.1, piece_megabytes=0.01, task_microseconds=2000.0, scene_megabytes=0.5))
    assert found["first"] == "scheduler"
    assert found["saturated_by_workers"]["scheduler"] == pytest.approx(50.0)
