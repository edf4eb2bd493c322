"""Sensors by name and by file: the rays that they cast, and the errors in a file that are refused."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("bpy")

from perfect_bvh_addon import DepthCamera, Raster, Rosette, SpinningLidar, load_sensor, sensor_names

AHEAD = np.array([0.0, 0.0, -1.0])


@pytest.mark.parametrize("name", sensor_names())
def test_a_sensor_that_is_brought_casts_what_it_promises(name: str) -> None:
    sensor = load_sensor(name)
    assert sensor.title and sensor.source.startswith("after the public data")
    pattern = sensor.pattern
    count = pattern.count(0.0, pattern.duration)
    rays = pattern.cast(0.0, pattern.duration, None)
    assert len(rays) == count > 5000
    assert not pattern.needs_camera
    assert np.isfinite(rays.directions).all() and (np.linalg.norm(rays.directions, axis=1) > 0.99).all()
    assert rays.times.min() >= 0.0 and rays.times.max() < pattern.duration
    # No shot is lost or duplicated at any cut of the time.
    cuts = np.array([0.0, 0.013, 0.041667, 0.0833, 0.25])
    parts = [pattern.cast(start, end, None).times for start, end in pairwise(cuts)]
    assert np.array_equal(np.concatenate(parts), pattern.cast(0.0, 0.25, None).times)
    assert [len(part) for part in parts] == [pattern.count(a, b) for a, b in pairwise(cuts)]


def test_the_64_lines_are_two_blocks() -> None:
    pattern = load_sensor("spinning-64").pattern
    assert isinstance(pattern, SpinningLidar)
    steps = np.diff(pattern.elevations)
    assert len(steps) == 63 and steps.min() > 0.2
    assert steps[:31].mean() == pytest.approx(1 / 2, abs=0.02) and steps[32:].mean() == pytest.approx(1 / 3, abs=0.02)


def test_a_rosette_stays_in_its_circle_and_fills_it() -> None:
    rays = Rosette(field_of_view=40.0, duration=1.0).cast(0.0, 1.0, None)
    angles = np.degrees(np.arccos(np.clip(rays.directions @ AHEAD, -1.0, 1.0)))
    assert angles.max() == pytest.approx(20.0, abs=0.05)
    assert np.allclose(np.linalg.norm(rays.directions, axis=1), 1.0)
    around = np.arctan2(rays.directions[:, 1], rays.directions[:, 0])
    counts, _, _ = np.histogram2d(angles, around, bins=(5, 8), range=((0, 20), (-math.pi, math.pi)))
    assert counts.min() > 100


def test_a_raster_goes_from_the_left_above_to_the_right_below() -> None:
    rays = Raster(width=20, height=10, horizontal=90.0, vertical=30.0, rate=5.0).cast(0.0, 0.2, None)
    first, last = rays.directions[0], rays.directions[-1]
    assert first[0] < -0.5 and first[1] > 0.2 and last[0] > 0.5 and last[1] < -0.2
    assert rays.ring_ids.tolist() == np.repeat(np.arange(10), 20).tolist()
    assert np.allclose(np.diff(rays.times), 0.2 / 200)


def test_a_depth_camera_measures_along_its_axis() -> None:
    camera = DepthCamera(width=8, height=6, horizontal=90.0, vertical=60.0, rate=10.0)
    rays = camera.cast(0.0, 0.1, None)
    assert (rays.directions[:, 2] == -1.0).all()
    assert rays.directions[:, 0].max() == pytest.approx(1.0 - 1.0 / 8)
    assert set(rays.times.tolist()) == {0.0}
    assert camera.count(0.0, 0.25) == 3 * 48


# Files ---------------------------------------------------------------------------------------------------------------


def test_a_file_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('kind = "spinning"\nelevations = [-1, 0.5]\ncolumns = 10\nrate = 5\nmax_distance = 7.5\n')
    sensor = load_sensor(path)
    assert sensor.name == "mine"
    assert sensor.pattern == SpinningLidar(elevations=(-1.0, 0.5), columns=10, rate=5, max_distance=7.5)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('kind = "spining"', r"kind must be one of .*'spining' \(is it 'spinning'\?\)"),
        ("columns = 3", "kind must be one of spinning, rosette"),
        ('kind = "spinning"\ncolums = 3', r"has no 'colums' \(is it 'columns'\?\)"),
        ('kind = "spinning"\ncolumns = "3"', "columns of a spinning sensor must be a number"),
        ('kind = "spinning"\ncolumns = true', "columns of a spinning sensor must be a number"),
        ('kind = "spinning"\ncolumns = 2.5', "columns must be an integer"),
        ('kind = "spinning"\nelevations = [100.0]', "elevations must be degrees"),
        ('kind = "spinning"\nelevations = { first = 1.0 }', "first, last and count"),
        ('kind = "spinning"\nelevations = ["a"]', "must be a list of numbers"),
        ('kind = "rosette"\nturns = [1.0]', "turns must be two numbers"),
        ('kind = "rosette"\nrate = 0.0', "rate, in cycles per second, must be a finite number above 0, got 0.0"),
        ('kind = "raster"\nhorizontal = 0', "horizontal, in degrees, must be a number above 0 and up to 360"),
        ('kind = "raster"\nmin_distance = 5.0\nmax_distance = 4.0', "min_distance must be at least 0"),
        (
            'kind = "depth camera"\nvertical = 179.0',
            "vertical, in degrees, must be a number above 0 and up to 170",
        ),
        ('kind = "depth camera"\nbaseline = inf', "baseline must be a finite number, got inf"),
        ("kind = ", "Invalid value"),
        ('kind = ["spinning"]', "kind must be one of"),
        ('kind = "spinning"\nelevations = { first = [1], last = 2, count = 3 }', "first, last and count"),
        ('kind = "spinning"\nelevations = { first = 1, last = 2, count = true }', "first, last and count"),
        ('kind = "spinning"\nrate = 1e30', "rate of a spinning sensor must be a number of usual size"),
        (f'kind = "spinning"\nrate = {"9" * 400}', "number of usual size, got 999"),
        ('kind = "depth camera"\nbaseline = 1e300', "number of usual size"),
        ('title = 3\nkind = "raster"', "title must be text"),
    ],
)
def test_what_a_file_may_not_say_is_named(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=said) as raised:
        load_sensor(path)
    assert str(path) in str(raised.value)


def test_a_name_that_is_none_brings_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"there is no 'spining-16' \(is it 'spinning-16'\?\)"):
        load_sensor("spining-16")
    with pytest.raises(OSError, match="missing"):
        load_sensor(tmp_path / "missing.toml")


@pytest.mark.parametrize("made", [Rosette, Raster, DepthCamera])
def test_a_range_must_be_one(made: Any) -> None:
    with pytest.raises(ValueError, match=f"{made.__name__}: min_distance"):
        made(min_distance=2.0, max_distance=1.0)
