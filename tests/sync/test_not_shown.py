"""The line that counts the unsupported features of an image."""

from __future__ import annotations

import pytest
from perfect_bvh_addon.sync.not_shown import Kind, NotShown, summarize

_ALL = "2 libraries missing, 1 light simplified, 1 world simplified"


def row(kind: Kind, uid: int, text: str = "x is unsupported; y is used") -> NotShown:
    return NotShown(kind, f"name {uid}", uid, text)


@pytest.mark.parametrize(
    ("rows", "line"),
    [
        ([], ""),
        ([row("object", 1)], "1 object not shown"),
        (
            [row("object", 9), row("material", 1), row("material", 2), row("material", 3), row("material", 3, "other")],
            "3 materials simplified, 1 object not shown",
        ),
        ([row("setting", 0, "a"), row("setting", 0, "b"), row("dark", 0)], "No light, 2 settings ignored"),
        ([row("library", 4), row("library", 5), row("world", 1), row("light", 1)], _ALL),
    ],
)
def test_each_thing_counts_once(rows: list[NotShown], line: str) -> None:
    assert summarize(rows) == line


def test_a_row_is_a_sentence_that_begins_with_its_name() -> None:
    made = NotShown("material", "Wall", 3, "Noise Texture is unsupported; its flat colour is used")
    assert str(made) == "Wall: Noise Texture is unsupported; its flat colour is used"
