"""What the README and docs/scripts.md show, works: their Python examples run, and lists are complete."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from perfect_bvh_addon.settings.modes import MODES

REPOSITORY = Path(__file__).resolve().parent.parent
TEXT = (REPOSITORY / "README.md").read_text(encoding="utf-8")
# The last line that each example prints, in the order of the files.
PRINTED = {
    "README.md": {
        "query": r"\w+.* is the highest, at \d+\.\d\d m",
        "lidar": r"\d+ points on \d+ objects from \d+ rays",
    },
    "docs/scripts.md": {
        "render": r".*",
        "arrays": r"sweep 2: \d\d\.\d\d% hit, \d+\.\d m wide",
        "times": r".* between 0\.458 and 0\.542",  # .1 to either side of the diagonal, 1.5 away from the axis
        "shutter": r"\d\.\d% of the view is blurred",
        "scan": r"\d+ points on \d+ objects from 189000 rays",
        "labels": r"\d+ things in the picture, \d+ of them hidden altogether",
    },
}
FILES = {"lidar": "gears.npz", "render": "gears.png", "scan": "gears.npz", "labels": "courtyard_labels.npz"}


def examples_of(document: str) -> list[str]:
    text = (REPOSITORY / document).read_text(encoding="utf-8")
    return re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def test_each_example_is_run() -> None:
    for document, names in PRINTED.items():
        assert len(examples_of(document)) == len(names), document


def test_the_readme_is_short() -> None:
    assert len(TEXT.splitlines()) <= 130


def test_the_modes_are_listed() -> None:
    table = (
        (REPOSITORY / "docs" / "preview.md").read_text(encoding="utf-8").split("| mode | shows |")[1].split("\n\n")[0]
    )
    assert sorted(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) == sorted(mode.word for mode in MODES)


def test_both_commands_install_the_same_system_packages() -> None:
    installs = re.findall(r"^\$\(command -v sudo\) sh -c '([^']+)'", TEXT, re.MULTILINE)
    assert len(installs) == 2
    assert installs[0] == installs[1]


@pytest.mark.parametrize(("document", "name"), [(document, name) for document in PRINTED for name in PRINTED[document]])
def test_an_example_runs(document: str, name: str, tmp_path: Path, repository: Path) -> None:
    example = examples_of(document)[list(PRINTED[document]).index(name)]
    (tmp_path / "blend_scenes").symlink_to(repository / "blend_scenes")
    (tmp_path / "example.py").write_text(example.replace('"/tmp/', f'"{tmp_path}/'))
    result = subprocess.run(
        [sys.executable, "example.py"], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )
    assert result.returncode == 0, result.stderr
    lines = [line for line in result.stdout.splitlines() if line.strip()] or [""]
    assert any(re.fullmatch(PRINTED[document][name], line) for line in lines[-3:]), result.stdout
    if name in FILES:
        assert (tmp_path / FILES[name]).stat().st_size > 1000
