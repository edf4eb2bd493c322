"""The examples in the engine's own README work, and the Pythons that it names are those that wheels are built for."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def text(repository: Path) -> str:
    return (repository / "native" / "README.md").read_text(encoding="utf-8")


def test_its_example_prints_what_it_says(text: str) -> None:
    (example,) = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    (expected,) = re.findall(r"^print\(.*\)  # (.*)$", example, re.MULTILINE)
    done = subprocess.run([sys.executable, "-c", example], capture_output=True, text=True, timeout=300, check=False)
    assert (done.stdout.strip(), done.stderr) == (expected, "")


def test_it_names_the_pythons_that_have_wheels(text: str, repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(repository / "release"))
    from wheel_platforms import PYTHONS

    (named,) = re.findall(r"wheels for CPython (.+?) on Linux", text)
    assert tuple(re.findall(r"3\.\d+", named)) == PYTHONS
    project = tomllib.loads((repository / "native" / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    classified = (re.fullmatch(r"Programming Language :: Python :: (3\.\d+)", line) for line in project["classifiers"])
    assert tuple(match[1] for match in classified if match) == PYTHONS
