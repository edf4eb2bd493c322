"""The check for faults that reviewers reject finds each fault, and none in the built zips."""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path

import pytest
from extension.zips import PLATFORMS, REPOSITORY, need_zip

sys.path.insert(0, str(REPOSITORY / "release"))
import listing_check
from listing_check import faults_of_zip, reason_for

MANIFEST = """id = "perfect_bvh"
version = "0.2.0"
name = "Perfect BVH"
tagline = "Casts rays"
maintainer = "We"
type = "add-on"
blender_version_min = "4.2.0"
license = ["SPDX:GPL-3.0-or-later"]
platforms = ["linux-x64", "windows-x64"]
[permissions]
files = "Write images"
[build.generated]
platforms = ["linux-x64"]
"""
GOOD = {"blender_manifest.toml": MANIFEST, "LICENSE": "GPL", "__init__.py": "import sys\nsys.modules.get('bpy')\n"}
WITHOUT_FILES = MANIFEST.replace('files = "Write images"', 'camera = "Look"')
BAD = {
    "another wheel": ({"wheels/a-1-cp311-cp311-win_amd64.whl": ""}, "is for another platform than linux-x64"),
    "numpy": ({"wheels/numpy-2.0-cp311-cp311-manylinux_2_28_x86_64.whl": ""}, "Blender has numpy"),
    "two platforms": (
        {"blender_manifest.toml": MANIFEST.partition("[build")[0]},
        "expected one platform in a zip, got linux-x64, windows-x64",
    ),
    "binary": ({"a.so": ""}, "a.so: is compiled and in no wheel"),
    "updater": ({"a.py": "URL = 'https://api.github.com/x'"}, "a.py:1: updates or installs by itself"),
    "installer": ({"a.py": "bpy.ops.extensions.package_install()"}, "a.py:1: updates or installs by itself"),
    "eval": ({"a.py": "eval('1')"}, "a.py:1: calls eval"),
    "exec": ({"a.py": "exec('1')"}, "a.py:1: calls exec"),
    "path": ({"a.py": "import sys\nsys.path.append('x')"}, "a.py:2: changes sys.path"),
    "path set": ({"a.py": "sys.path = []"}, "a.py:1: changes sys.path"),
    "modules": ({"a.py": "del sys.modules['x']"}, "a.py:1: changes sys.modules"),
    "network": (
        {"a.py": "from urllib.request import urlopen"},
        "a.py:1: imports urllib.request without the permission",
    ),
    "files": ({"blender_manifest.toml": WITHOUT_FILES, "a.py": "open('x')"}, "a.py:1: open without the permission"),
    "permissions": ({"blender_manifest.toml": MANIFEST.replace("[permissions]", "[other]")}, "has no `permissions`"),
    "licence": ({"blender_manifest.toml": MANIFEST.replace("license", "licence")}, "has no `license`"),
    "tests": ({"tests/test_a.py": ""}, "tests/test_a.py: does not belong"),
    "cache": ({"a/__pycache__/b.pyc": ""}, "does not belong"),
    "scene": ({"a.blend": ""}, "a.blend: does not belong"),
    "hidden": ({"a/.DS_Store": ""}, "does not belong"),
}


def write_zip(folder: Path, files: dict[str, str]) -> Path:
    path = folder / "perfect_bvh.zip"
    with zipfile.ZipFile(path, "w") as file:
        for name, text in files.items():
            file.writestr(name, text)
    return path


def test_a_good_zip_has_no_fault(tmp_path: Path) -> None:
    assert list(faults_of_zip(write_zip(tmp_path, GOOD))) == []


@pytest.mark.parametrize("kind", BAD)
def test_a_fault_is_found(kind: str, tmp_path: Path) -> None:
    files, message = BAD[kind]
    (fault,) = faults_of_zip(write_zip(tmp_path, GOOD | files))
    assert message in fault
    assert not reason_for(fault)


def test_a_missing_licence_and_a_size_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listing_check, "MOST_BYTES", 100)
    files = {name: text for name, text in GOOD.items() if name != "LICENSE"}
    size, licence = faults_of_zip(write_zip(tmp_path, files))
    assert "at most 100 are taken" in size and licence == "LICENSE: is missing"


def test_code_in_the_engines_wheel_is_looked_at(tmp_path: Path) -> None:
    name = "wheels/perfect_bvh_engine-1-cp311-cp311-manylinux_2_28_x86_64.whl"
    (tmp_path / "wheel").mkdir()
    wheel = write_zip(tmp_path / "wheel", {"perfect_bvh/a.py": "eval('1')"})
    path = write_zip(tmp_path, GOOD)
    with zipfile.ZipFile(path, "a") as file:
        file.write(wheel, name)
    assert list(faults_of_zip(path)) == ["perfect_bvh/a.py:1: calls eval"]


def test_the_sources_have_no_fault_that_nobody_explained(tmp_path: Path) -> None:
    sources = {path.relative_to(REPOSITORY / "addon").as_posix(): path for path in (REPOSITORY / "addon").rglob("*.py")}
    sources |= {path.as_posix(): path for path in (REPOSITORY / "native" / "python").rglob("*.py")}
    permissions = {"files": "Write images"}
    faults = [
        fault
        for name, path in sources.items()
        for fault in listing_check.faults_of_code(name, path.read_text(encoding="utf-8"), permissions)
    ]
    assert [fault for fault in faults if not reason_for(fault)] == []
    for start, word, _ in listing_check.EXPLAINED:
        assert any(fault.startswith(start) and word in fault for fault in faults), (start, word)


@pytest.mark.parametrize("platform", PLATFORMS)
def test_a_built_zip_has_no_fault_that_nobody_explained(platform: str) -> None:
    assert [fault for fault in faults_of_zip(need_zip(platform)) if not reason_for(fault)] == []
