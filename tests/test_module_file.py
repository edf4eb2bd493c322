"""The compiled module as a file: its exports, its dependencies, its version."""

from __future__ import annotations

import re
import subprocess
import tomllib
from importlib.util import find_spec
from pathlib import Path

import perfect_bvh
import pytest

# Part of every Linux with a C++ runtime, and none of them a library that Blender brings along in its own copy.
SYSTEM_LIBRARIES = {"libstdc++.so.6", "libgcc_s.so.1", "libm.so.6", "libc.so.6", "ld-linux-x86-64.so.2"}


@pytest.fixture(scope="module")
def module_file() -> Path:
    spec = find_spec("perfect_bvh._core")
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin)


def output_of(*command: str | Path) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def test_it_exports_only_its_entry_point(module_file: Path) -> None:
    """Anything else, such as operator new, could be taken over by a library in Blender's process, or take over its."""
    symbols = output_of("nm", "-D", "--defined-only", "--format=just-symbols", module_file).split()
    assert symbols == ["PyInit__core"]


def test_it_needs_only_system_libraries(module_file: Path) -> None:
    needed = set(re.findall(r"\(NEEDED\).*\[(.+)\]", output_of("readelf", "--dynamic", "--wide", module_file)))
    assert "libc.so.6" in needed
    assert needed <= SYSTEM_LIBRARIES


def test_it_has_the_version_of_the_manifest(repository: Path) -> None:
    manifest = tomllib.loads((repository / "addon" / "blender_manifest.toml").read_text(encoding="utf-8"))
    assert perfect_bvh.__version__ == manifest["version"]
