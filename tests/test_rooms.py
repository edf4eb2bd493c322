"""The table of files and lines by folder."""

from __future__ import annotations

from pathlib import Path

import pytest
from rooms import count_rooms, table


def test_rooms_are_the_products_and_every_file_counts(repository: Path) -> None:
    if not (repository / ".git").exists():
        pytest.skip("no .git: the files are those that git lists")
    rooms = count_rooms(repository)
    assert {"addon/sync", "native/src/traverse", "native/python/perfect_bvh"} <= rooms.keys()
    files, lines = rooms["addon/events"]
    found = list((repository / "addon" / "events").glob("*.py"))
    assert (files, lines) == (len(found), sum(path.read_bytes().count(b"\n") for path in found))


def test_a_table_says_what_grew_went_and_came() -> None:
    rows = table({"a": (2, 30), "new": (1, 5)}, {"a": (1, 40), "old": (3, 7)}).splitlines()
    assert [row.split() for row in rows[1:]] == [
        ["a", "2", "+1", "30", "-10"],
        ["new", "1", "+1", "5", "+5"],
        ["old", "0", "-3", "0", "-7"],
        ["all", "3", "-1", "35", "-12"],
    ]
