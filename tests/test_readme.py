"""What the README shows, works: its Python examples run, and its lists are complete."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from perfect_bvh_addon.settings.modes import MODES

README = Path(__file__).resolve().parent.parent / "README.md"
TEXT = README.read_text(encoding="utf-8")
EXAMPLES = re.findall(r"^```python\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)


def test_there_are_examples() -> None:
    assert len(EXAMPLES) == 7


def test_it_lists_the_modes() -> None:
    table = TEXT.split("| mode | shows |")[1].split("\n\n")[0]
    assert sorted(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) == sorted(mode.word for mode in MODES)


def test_both_commands_install_the_same_system_packages() -> None:
    installs = re.findall(r"^\$\(command -v sudo\) sh -c '([^']+)'", TEXT, re.MULTILINE)
    assert len(installs) == 2
    assert installs[0] == installs[1]


@pytest.mark.parametrize("example", EXAMPLES, ids=["query", "arrays", "times", "shutter", "scan", "labels", "render"])
def test_an_example_runs(example: str, tmp_path: Path, repository: Path) -> None:
    (tmp_path / "blend_scenes").symlink_to(repository / "blend_scenes")
    (tmp_path / "example.py").write_text(example.replace('"/tmp/', f'"{tmp_path}/'))
    result = subprocess.run(
        [sys.executable, "example.py"], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )
    assert result.returncode == 0, result.stderr
    if "write_still" in example:
        assert (tmp_path / "gears.png").read_bytes().startswith(b"\x89PNG")
    elif "SpinningLidar" in example:
        assert re.search(r"^\d+ points on \d+ objects from 189000 rays$", result.stdout, re.MULTILINE)
        assert (tmp_path / "gears.npz").is_file()
    elif "blade" in example:  # .1 to either side of the diagonal, 1.5 away from the axis
        assert re.search(r"between 0\.458 and 0\.542$", result.stdout, re.MULTILINE)
    elif "shutter=(" in example:
        assert re.search(r"^27 things move\n\d\.\d% of the view is blurred$", result.stdout, re.MULTILINE)
    elif "label_image" in example:
        assert re.search(r"^\d+ things in the picture, \d+ of them hidden altogether$", result.stdout, re.MULTILINE)
        assert (tmp_path / "courtyard_labels.npz").is_file()
    elif "sweep" in example:
        sweeps = re.findall(r"^sweep (\d): \d\d\.\d\d% hit, \d+\.\d m wide$", result.stdout, re.MULTILINE)
        assert sweeps == ["0", "1", "2"]
    else:
        assert re.search(r"is the highest, at \d+\.\d\d m", result.stdout)
