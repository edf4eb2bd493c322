"""Every system can hold the checkout: names that Windows takes, and no two that differ by their case alone."""

from __future__ import annotations

import subprocess
from collections import Counter
from pathlib import Path, PurePosixPath

import pytest
from perfect_bvh_addon.support.files import find_fault

LONGEST = 120  # of 259, as Windows counts: the rest is where users put it


@pytest.fixture(scope="module")
def names(repository: Path) -> list[PurePosixPath]:
    if not (repository / ".git").exists():
        pytest.skip("no .git: the names are those that git lists")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=repository, capture_output=True, check=True).stdout
    return [PurePosixPath(name) for name in listed.decode().split("\0") if name]


def test_windows_takes_every_name(names: list[PurePosixPath]) -> None:
    assert names
    assert [f"{name}: {fault}" for name in names if (fault := find_fault(name, "win32"))] == []
    assert [name for name in names if len(str(name)) > LONGEST] == []


def test_no_two_differ_by_their_case_alone(names: list[PurePosixPath]) -> None:
    paths = {part for name in names for part in (name, *name.parents)}
    counts = Counter(str(path).casefold() for path in paths)
    assert [path for path, count in counts.items() if count > 1] == []
