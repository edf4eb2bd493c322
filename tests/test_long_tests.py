"""The list of tests that are left to `pytest --long`."""

from __future__ import annotations

from pathlib import Path


def test_each_of_them_is_there(repository: Path) -> None:
    lines = (repository / "tests" / "long_tests.txt").read_text().splitlines()
    names = [line for line in lines if line and not line.startswith("#")]
    assert names == sorted(set(names))
    for name in names:
        path, _, test = name.partition("::")
        assert f"def {test.partition('[')[0]}(" in (repository / path).read_text(), name
