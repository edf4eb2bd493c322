"""Fixtures that every test folder shares."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from oracles import recorded_hooks

STARTED = pytest.StashKey[float]()
REPOSITORY = Path(__file__).resolve().parent.parent
LONG_TESTS = REPOSITORY / "tests" / "long_tests.txt"
# Files that take longest for the number of their tests. Begun last, they would leave one core waiting for the other.
LONGEST_FILES = ("test_arm64.py", "test_examples.py", "test_readme.py", "test_soak.py", "test_scenes.py")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Starts the longest files first, in any folder; skips the tests for `--long`."""
    long = {line for line in LONG_TESTS.read_text().splitlines() if line and not line.startswith("#")}
    for item in items if not config.getoption("--long") else ():
        if item.get_closest_marker("long") or item.nodeid in long:
            item.add_marker(pytest.mark.skip(reason="--long is not given"))
    items.sort(key=lambda item: item.path.name not in LONGEST_FILES)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--seconds", type=float, help="skip the tests that have not begun after so many seconds")
    parser.addoption("--long", action="store_true", help="run the tests marked `long` too")
    recorded_hooks.add_options(parser)


def pytest_configure(config: pytest.Config) -> None:
    config.stash[STARTED] = time.monotonic()
    config.pluginmanager.register(recorded_hooks.Hooks(recorded_hooks.mode_of(config)), "images_of_cycles")


def pytest_runtest_setup(item: pytest.Item) -> None:
    seconds = item.config.getoption("--seconds")
    if seconds is not None and time.monotonic() - item.config.stash[STARTED] > seconds:
        pytest.skip(f"the {seconds:g} seconds of a quick check are over")


@pytest.fixture(scope="session")
def repository() -> Path:
    """The checkout's folder."""
    return REPOSITORY


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers, the same in every run."""
    return np.random.default_rng(20260421)


@pytest.fixture
def one_thread() -> Iterator[None]:
    """Limits the engine to one thread during the test, so that long work stays long on a machine with many."""
    import perfect_bvh

    perfect_bvh.set_thread_count(1)
    yield
    perfect_bvh.set_thread_count(0)


@pytest.fixture
def hears_ctrl_c() -> Iterator[None]:
    """Handles Ctrl-C as in a terminal: a process that a shell starts in the background ignores the signal."""
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, previous)


@pytest.fixture(scope="session")
def blend_file(repository: Path) -> Callable[[str], Path]:
    """Path of a scene in blend_scenes by its name: `blend_file("courtyard")`."""

    def path_of(name: str) -> Path:
        path = repository / "blend_scenes" / f"{name}.blend"
        assert path.is_file(), f"{path} is missing; blend_scenes/make_scenes.py writes it"
        return path

    return path_of
