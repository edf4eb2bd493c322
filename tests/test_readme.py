"""The README is correct: its Python examples run, and lists are complete."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from perfect_bvh_addon.settings.modes import MODES

REPOSITORY = Path(__file__).resolve().parent.parent
TEXT = (REPOSITORY / "README.md").read_text(encoding="utf-8")
# The last line that each example prints, in their order.
PRINTED = {
    "query": r"\w+.* is the highest, at \d+\.\d\d m",
    "lidar": r"\d+ points on \d+ objects from \d+ rays",
}
FILES = {"lidar": "gears.npz"}
EXAMPLES = re.findall(r"^```python\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)


def test_each_example_is_run() -> None:
    assert len(EXAMPLES) == len(PRINTED)


def test_the_readme_is_short() -> None:
    assert len(TEXT.splitlines()) <= 130


def test_each_question_has_a_short_answer_and_a_link() -> None:
    assert "](docs/questions.md)" in TEXT
    text = (REPOSITORY / "docs" / "questions.md").read_text(encoding="utf-8")
    answers = dict(re.findall(r"^\*\*(.+?\?)\*\* (.+?)\n(?=\n|\Z)", text, re.MULTILINE | re.DOTALL))
    assert len(answers) >= 20
    for question, answer in answers.items():
        assert "](" in answer, question
        assert len(re.findall(r"[.?](?=\s|$)", answer)) <= 3, question


def test_the_modes_are_listed() -> None:
    table = (
        (REPOSITORY / "docs" / "preview.md").read_text(encoding="utf-8").split("| mode | shows |")[1].split("\n\n")[0]
    )
    assert sorted(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) == sorted(mode.word for mode in MODES)


def test_both_commands_install_the_same_system_packages() -> None:
    installs = re.findall(r"^\$\(command -v sudo\) sh -c '([^']+)'", TEXT, re.MULTILINE)
    assert len(installs) == 2
    assert installs[0] == installs[1]


@pytest.mark.parametrize("name", PRINTED)
def test_an_example_runs(name: str, tmp_path: Path, repository: Path) -> None:
    example = EXAMPLES[list(PRINTED).index(name)]
    (tmp_path / "blend_scenes").symlink_to(repository / "blend_scenes")
    (tmp_path / "example.py").write_text(example.replace('"/tmp/', f'"{tmp_path}/'))
    result = subprocess.run(
        [sys.executable, "example.py"], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )
    assert result.returncode == 0, result.stderr
    lines = [line for line in result.stdout.splitlines() if line.strip()] or [""]
    assert any(re.fullmatch(PRINTED[name], line) for line in lines[-3:]), result.stdout
    if name in FILES:
        assert (tmp_path / FILES[name]).stat().st_size > 1000
