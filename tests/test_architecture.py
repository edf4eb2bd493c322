"""ARCHITECTURE.md is true as far as a test can check: its layers are the enforced ones, and its paths exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from test_layers import ADDON_LAYERS, NATIVE_LAYERS, RENDER_LAYERS

LONGEST = 270
# Folders that a path in the text begins with, and the placeholders in it for names that a reader adds.
TOP = ("addon", "blend_scenes", "native", "release", "tests")
INVENTED = re.compile(r"(^|_)x(\.|$)")


@pytest.fixture(scope="module")
def text(repository: Path) -> str:
    return (repository / "ARCHITECTURE.md").read_text(encoding="utf-8")


def test_it_can_be_read_in_one_sitting(text: str) -> None:
    assert len(text.splitlines()) <= LONGEST


def test_its_layers_are_the_enforced_ones(text: str) -> None:
    native, render, addon = re.findall(r"^```\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert tuple(native.split()) == NATIVE_LAYERS
    assert tuple(render.split()) == RENDER_LAYERS
    assert tuple(tuple(row.split()) for row in addon.splitlines()) == ADDON_LAYERS


def test_each_room_is_described(text: str) -> None:
    described = {
        room for row in re.findall(r"^\| (`\w+`.*?) \|", text, re.MULTILINE) for room in re.findall(r"\w+", row)
    }
    assert described >= {room for floor in ADDON_LAYERS for room in floor} - {"__init__"}


def test_each_path_that_it_names_exists(text: str, repository: Path) -> None:
    named = {path for path in re.findall(r"`([\w./]+)`", text) if path.split("/")[0] in TOP and "/" in path}
    assert len(named) > 60
    real = {path for path in named if not INVENTED.search(path.rsplit("/", 1)[-1])}
    assert [path for path in sorted(real) if not (repository / path).exists()] == []


def test_the_slides_of_the_lecture_have_files_of_their_own(repository: Path) -> None:
    table = (
        (repository / "docs" / "ideas.md").read_text(encoding="utf-8").split("|---|---|---|---|\n")[1].split("\n\n")[0]
    )
    for row in table.splitlines():
        _, slide, idea, files, shown, _ = (cell.strip() for cell in row.split("|"))
        paths = re.findall(r"`(native/[\w./]+)`", files)
        assert slide and idea and paths, row
        assert any("lecture" in (repository / path).read_text(encoding="utf-8").lower() for path in paths), paths
        assert re.search(r"\]\(|chart|`", shown), row
    assert len(table.splitlines()) >= 12
