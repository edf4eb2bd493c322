"""Makes the folder for the engine's source distribution: native/, without references to files outside it.

python release/engine_sources.py FOLDER

FOLDER is replaced. Its pyproject.toml has the version from the add-on's manifest.
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

from manifest import read_version

REPOSITORY = Path(__file__).resolve().parent.parent
NATIVE = REPOSITORY / "native"
LEFT_OUT = ("__pycache__", "*.so", "*.pyd", "benchmarks", "CMakePresets.json")


def make_folder(folder: Path) -> None:
    """All that `pip install FOLDER` needs; SystemExit if a file lacks an expected line."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(NATIVE, folder, ignore=shutil.ignore_patterns(*LEFT_OUT))
    project = folder / "pyproject.toml"
    text = project.read_text(encoding="utf-8")
    for pattern, replacement in (
        (r'dynamic = \["version"\]', f'version = "{read_version()}"'),
        (r'build-dir = "\.\./build/engine-', 'build-dir = "build/'),
        (r"(?s)\n# The add-on's manifest [^\n]*\n\[tool\.scikit-build\.metadata\.version\].*?(?=\n\[|\Z)", ""),
        (r"(?s)\A# .*?\n\n", ""),
    ):
        text, count = re.subn(pattern, replacement, text)
        if count != 1:
            raise SystemExit(f"engine_sources: expected {pattern!r} once in native/pyproject.toml, got {count} times")
    project.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    make_folder(Path(sys.argv[1]))
