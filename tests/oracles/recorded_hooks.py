"""pytest's side of `recorded`: notes the current test file, and reports newly rendered images in the summary."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from . import recorded

TESTS = Path(__file__).resolve().parent.parent
FOLDER = TESTS / "cycles_images"


def add_options(parser: pytest.Parser) -> None:
    group = parser.getgroup("images of Cycles")
    group.addoption("--record-cycles", action="store_true", help="render all, write tests/cycles_images; whole files")
    group.addoption("--live-cycles", action="store_true", help="render all and compare it with tests/cycles_images")


def mode_of(config: pytest.Config) -> recorded.Mode:
    """The recordings in the mode of the options.

    Raises:
        pytest.UsageError: --record-cycles for parts of files, or in several processes.
    """
    option = config.option
    if not option.record_cycles:
        return "live" if option.live_cycles else "recall"
    if option.live_cycles or option.keyword or option.markexpr or any("::" in name for name in config.args):
        raise pytest.UsageError(
            "--record-cycles replaces what is recorded for a file of tests, so it takes whole files: "
            "leave out --live-cycles, -k, -m and ::"
        )
    if getattr(option, "numprocesses", None):
        raise pytest.UsageError("--record-cycles writes files in one process: add -n 0")
    return "record"


class Hooks:
    """A plugin for pytest, in each of its processes."""

    def __init__(self, mode: recorded.Mode, folder: Path = FOLDER) -> None:
        self.recordings = recorded.Recordings(folder, mode)
        self.counts: dict[str, Counter[str]] = {}
        self.failed: set[str | None] = set()

    def pytest_sessionstart(self) -> None:
        recorded.active = self.recordings

    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        self.recordings.current = item.path.relative_to(TESTS).with_suffix("").as_posix()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item) -> Iterator[None]:
        report: Any = yield
        report.cycles = dict(self.recordings.take_counts())  # goes with the report to the process that sums up
        if report.failed:
            self.failed.add(self.recordings.current)
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        counts = Counter(getattr(report, "cycles", {}))
        self.counts.setdefault(report.location[0], Counter()).update(counts)

    def pytest_sessionfinish(self) -> None:
        recorded.active = None
        if self.recordings.mode == "record":
            self.recordings.write(self.failed)

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        total = sum(self.counts.values(), Counter())
        if self.recordings.mode == "recall" and total["rendered"]:
            terminalreporter.section("images of Cycles")
            files = {name: counts["rendered"] for name, counts in self.counts.items() if counts["rendered"]}
            for name, count in files.items():
                terminalreporter.line(f"{name}: {count} rendered, for they are not recorded")
            terminalreporter.line(f"{total['recalled']} came from tests/cycles_images. To record the others:")
            terminalreporter.line(f"nox -s cycles_images -- {' '.join(files)}")
