"""The calibration: its file, the measurement, and the treatment of an invalid file."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from pathlib import Path

import perfect_bvh
import pytest
from perfect_bvh import calibration
from perfect_bvh.calibrate import COARSE_NANOSECONDS, calibrate, choose_clock
from perfect_bvh.calibration import BuilderCost, Calibration, CalibrationError

NUMBERS = Calibration(
    20.0, 15.0, 10.0, 12.0, 60.0, 0.4, {name: BuilderCost(100.0, 200.0) for name in calibration.BUILDERS}, "here"
)


@pytest.fixture
def file(tmp_path, monkeypatch) -> Path:
    path = tmp_path / "deep" / "calibration.json"
    monkeypatch.setenv(calibration.VARIABLE, str(path))
    return path


def test_a_file_comes_back_as_it_was_written(file):
    NUMBERS.save(file)
    NUMBERS.save(file)  # over the old one
    assert calibration.read_calibration() == NUMBERS
    assert Calibration.load(file).machine == "here"
    assert [path.name for path in file.parent.iterdir()] == [file.name]


def test_without_a_file_the_package_has_one(file):
    assert not file.exists()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert calibration.read_calibration() == Calibration.load(calibration.DEFAULT_FILE)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"{", "is not JSON"),
        (b"\xff\xfe\xff", "is not JSON"),
        (b"[]", "version None"),
        (b'{"version": 0}', "version 0"),
        (json.dumps({"version": 1, **NUMBERS.as_numbers()}).encode(), "version 1, but this engine reads version 2"),
        (b'{"version": 2}', "missing or unknown numbers"),
        (json.dumps({"version": 2, **NUMBERS.as_numbers(), "builders": 3}).encode(), "missing or unknown numbers"),
        (json.dumps({"version": 2, **NUMBERS.as_numbers(), "builders": {}}).encode(), "builders must be"),
        (json.dumps({"version": 2, **NUMBERS.as_numbers(), "refit_nanoseconds": -1}).encode(), "refit_nanoseconds"),
        (json.dumps({"version": 2, **NUMBERS.as_numbers(), "rotation_gain": 2}).encode(), "rotation_gain must be"),
        (json.dumps({"version": 2, **NUMBERS.as_numbers(), "node_nanoseconds": None}).encode(), "node_nanoseconds"),
        (json.dumps({"version": 2, **NUMBERS.as_numbers(), "leaf_nanoseconds": float("inf")}).encode(), "leaf_nano"),
    ],
)
def test_a_file_that_is_no_good_is_named_and_not_used(file, content, complaint):
    file.parent.mkdir()
    file.write_bytes(content)
    with pytest.raises(CalibrationError, match=complaint) as error:
        Calibration.load(file)
    assert str(file) in str(error.value)
    with pytest.warns(RuntimeWarning, match=complaint) as caught:
        assert calibration.read_calibration() == Calibration.load(calibration.DEFAULT_FILE)
    assert "perfect-bvh calibrate" in str(caught[0].message)


def test_a_folder_in_its_place_is_named_and_not_used(file):
    file.mkdir(parents=True)
    with pytest.warns(RuntimeWarning, match="the calibration is not used"):
        assert calibration.read_calibration() == Calibration.load(calibration.DEFAULT_FILE)


def test_a_failed_write_leaves_the_old_file(file, monkeypatch):
    NUMBERS.save(file)

    def fail(self, target):
        raise OSError("no space")

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(OSError, match="no space"):
        NUMBERS.save(file)
    assert Calibration.load(file) == NUMBERS
    assert [path.name for path in file.parent.iterdir()] == [file.name]


def test_measuring_can_be_watched_and_stopped():
    seen = []

    def stop(done):
        seen.append(done)
        return False

    threads = perfect_bvh.thread_count()
    with pytest.raises(perfect_bvh.Cancelled):
        calibrate(stop)
    assert len(seen) == 1 and 0 < seen[0] < 1
    assert perfect_bvh.thread_count() == threads


class FakeTime:
    """Two clocks that advance by 50 ns whenever one is read; a thread's own shows every `step` only."""

    def __init__(self, step: int, start: int = 0) -> None:
        self.now, self.step = start, step

    def common(self) -> int:
        self.now += 50
        return self.now

    def own(self) -> int:
        self.now += 50
        return self.now // self.step * self.step


@pytest.mark.parametrize("step", [1, 100, 10_000])
def test_a_fine_clock_of_the_thread_is_used(step):
    fake = FakeTime(step)
    assert choose_clock(fake.own, fake.common) == fake.own


@pytest.mark.parametrize("start", [0, 15_624_950, 15_624_850])  # the latter two just before it moves
@pytest.mark.parametrize("step", [15_625_000, 10_000_000_000])
def test_a_coarse_clock_of_the_thread_is_not_used(step, start):
    """A clock as on Windows, or one that never moves."""
    fake = FakeTime(step, start)
    assert choose_clock(fake.own, fake.common) == fake.common
    assert fake.now - start < 5 * COARSE_NANOSECONDS


def test_the_clock_of_this_system_moves_while_it_is_looked_at():
    clock = choose_clock()
    assert len({clock() for _ in range(10_000)}) > 100


def test_the_command_measures_and_keeps(tmp_path):
    path = tmp_path / "measured.json"
    code = "import sys; from perfect_bvh_addon.cli import main; sys.exit(main(['calibrate', '-o', sys.argv[1]]))"
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    measured = Calibration.load(path)
    assert str(path) in done.stdout and "binned" in done.stdout
    assert measured != NUMBERS and all(cost.build_nanoseconds > 0.0 for cost in measured.builders.values())


def test_the_command_says_where_it_cannot_write(tmp_path):
    (tmp_path / "file").write_text("")
    code = (
        "import sys; from perfect_bvh_addon.cli import main; import perfect_bvh.calibrate as module\n"
        "from perfect_bvh.calibration import DEFAULT_FILE, Calibration\n"
        "module.calibrate = lambda progress: Calibration.load(DEFAULT_FILE)\n"
        "sys.exit(main(['calibrate', '-o', sys.argv[1]]))"
    )
    path = tmp_path / "file" / "calibration.json"
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 2
    assert f"cannot write {path}" in done.stderr
