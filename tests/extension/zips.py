"""Where the zips are that `nox -s extension` has built, one for each of Blender's platforms."""

from __future__ import annotations

import platform
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
PLATFORMS = ("linux-x64", "linux-arm64", "windows-x64", "windows-arm64", "macos-x64", "macos-arm64")
SYSTEMS = {"Linux": "linux", "Windows": "windows", "Darwin": "macos"}
MACHINES = {"x86_64": "x64", "amd64": "x64", "aarch64": "arm64", "arm64": "arm64"}


def this_platform() -> str:
    return f"{SYSTEMS[platform.system()]}-{MACHINES[platform.machine().lower()]}"


def zip_of(name: str) -> Path | None:
    """Return the zip of one platform, by the name that Blender's tool gives it."""
    found = list((REPOSITORY / "dist").glob(f"perfect_bvh-*-{name.replace('-', '_')}.zip"))
    assert len(found) <= 1, found
    return found[0] if found else None


def need_zip(name: str) -> Path:
    """Return the zip of one platform; skip the test if there is none."""
    found = zip_of(name)
    if found is None:
        pytest.skip(f"no zip for {name} in dist: `nox -s extension` builds it")
    return found
