"""CONTRIBUTING.md is true as far as a test can check: its sessions, presets, tests and paths exist."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def text(repository: Path) -> str:
    return (repository / "CONTRIBUTING.md").read_text(encoding="utf-8")


def test_the_sessions_exist(text: str, repository: Path) -> None:
    named = set(re.findall(r"nox -s (\w+)", text))
    files = (repository / "noxfile.py", repository / "release" / "sessions.py")
    sessions = "".join(path.read_text(encoding="utf-8") for path in files)
    assert {"quick", "lint", "extension"} <= named
    assert [name for name in named if not re.search(rf"^@nox\.session.*\ndef {name}\(", sessions, re.MULTILINE)] == []


def test_the_presets_exist(text: str, repository: Path) -> None:
    presets = json.loads((repository / "native" / "CMakePresets.json").read_text(encoding="utf-8"))["configurePresets"]
    named = set(re.findall(r"--preset (\w+)", text))
    assert named
    assert named <= {preset["name"] for preset in presets}


def test_the_tests_and_paths_exist(text: str, repository: Path) -> None:
    named = set(re.findall(r"(?<![\w/])((?:addon|native|release|tests|\.ci)/[\w./]*\w)", text))
    assert len(named) > 5
    assert [path for path in sorted(named) if not (repository / path).exists()] == []


def test_the_suite_and_the_test_that_it_names_exist(text: str, repository: Path) -> None:
    (suite,) = re.findall(r"--gtest_filter='(\w+)\*'", text)
    sources = "".join(path.read_text(encoding="utf-8") for path in (repository / "native" / "tests").glob("*.cpp"))
    assert f"TEST({suite}" in sources
    ((path, name),) = re.findall(r"(tests/\S+\.py) -k (\w+)", text)
    assert re.search(rf"^def test_\w*{name}", (repository / path).read_text(encoding="utf-8"), re.MULTILINE)


def test_the_step_that_it_names_exists(text: str, repository: Path) -> None:
    (step,) = re.findall(r"WINDOWS_STEPS=(\w+)", text)
    sources = "".join(path.read_text(encoding="utf-8") for path in (repository / "tests" / "gui").glob("*.py"))
    assert f"def {step}(" in sources


def test_the_packages_are_those_of_the_readme(text: str, repository: Path) -> None:
    readme = (repository / "README.md").read_text(encoding="utf-8")
    (installed,) = re.findall(r"apt-get install (.*)", text)
    assert set(re.findall(r"--no-install-recommends ([\w .+-]+?)'", readme)[0].split()) <= set(installed.split())
