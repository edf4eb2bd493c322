"""The message to users if the engine cannot be loaded: which zip, which Blender, what to do; with faked systems."""

from __future__ import annotations

import json
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

import pytest
from child_process import environment_with_paths
from perfect_bvh_addon.settings import native_fault
from perfect_bvh_addon.settings.native_fault import NAMES, explain, read_manifest, this_platform

BEGINNING = "The native engine could not be loaded: "
SUFFIXES = {
    "linux-x86_64": ".cpython-{}-x86_64-linux-gnu.so",
    "linux-aarch64": ".cpython-{}-aarch64-linux-gnu.so",
    "win-amd64": ".cp{}-win_amd64.pyd",
    "win-arm64": ".cp{}-win_arm64.pyd",
    "macosx-11.0-arm64": ".cpython-{}-darwin.so",
    "macosx-10.13-x86_64": ".cpython-{}-darwin.so",
}


class Computer:
    """This one, as if it were another; with an engine's folder."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
        self._monkeypatch, self.folder = monkeypatch, folder

    def become(self, platform: str, python: str = "3.11") -> None:
        patch = self._monkeypatch.setattr
        patch(sysconfig, "get_platform", lambda: platform)
        patch(native_fault, "_python", lambda: python)
        suffix = SUFFIXES.get(platform, "none").format(python.replace(".", ""))
        patch(native_fault, "EXTENSION_SUFFIXES", [suffix])

    def add_module(self, platform: str, python: str = "311") -> None:
        (self.folder / f"_core{SUFFIXES[platform].format(python)}").touch()


@pytest.fixture
def computer(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Computer:
    return Computer(monkeypatch, tmp_path)


def manifest_of(platform: str, *pythons: str) -> dict[str, Any]:
    """The manifest of a zip for one platform, as Blender's tool splits it off."""
    wheels = [f"./wheels/perfect_bvh_engine-0.2.0-cp{python}-cp{python}-tag.whl" for python in pythons]
    generated = {"platforms": [platform], "wheels": wheels}
    return {
        "version": "0.2.0",
        "platforms": list(NAMES),
        "wheels": ["./wheels/a.whl"],
        "build": {"generated": generated},
    }


@pytest.mark.parametrize(
    ("platform", "expected"),
    [
        ("linux-x86_64", "linux-x64"),
        ("linux-aarch64", "linux-arm64"),
        ("win-amd64", "windows-x64"),
        ("win-arm64", "windows-arm64"),
        ("macosx-11.0-arm64", "macos-arm64"),
        ("macosx-10.13-x86_64", "macos-x64"),
        ("macosx-10.9-universal2", "macos-arm64"),
        ("freebsd-14.1-amd64", "freebsd-x64"),
    ],
)
def test_platforms_have_blender_s_names(
    computer: Computer, monkeypatch: pytest.MonkeyPatch, platform: str, expected: str
) -> None:
    computer.become(platform)
    monkeypatch.setattr(native_fault.platform, "machine", lambda: "arm64")
    assert this_platform() == expected


def test_this_platform_is_one_of_them() -> None:
    assert this_platform() in NAMES


@pytest.mark.parametrize(
    ("platform", "sentence"),
    [
        (
            "win-amd64",
            "this add-on is for Linux, but this system is Windows: install perfect_bvh-0.2.0-windows_x64.zip",
        ),
        ("win-arm64", "but this system is Windows on ARM: install perfect_bvh-0.2.0-windows_arm64.zip"),
        ("macosx-11.0-arm64", "but this system is macOS on Apple silicon: install perfect_bvh-0.2.0-macos_arm64.zip"),
        ("macosx-10.13-x86_64", "but this system is macOS on Intel: install perfect_bvh-0.2.0-macos_x64.zip"),
        ("linux-aarch64", "but this system is Linux on ARM: install perfect_bvh-0.2.0-linux_arm64.zip"),
        ("freebsd-14.1-amd64", "but this system is freebsd-x64: there is none for this system"),
    ],
)
def test_a_zip_of_another_platform_names_the_right_one(computer: Computer, platform: str, sentence: str) -> None:
    computer.become(platform)
    computer.add_module("linux-x86_64")
    told = explain(ImportError("DLL load failed"), manifest_of("linux-x64", "311"), computer.folder)
    assert told.startswith(f"{BEGINNING}this add-on is for Linux, ") and told.endswith(sentence)


def test_another_python_names_the_blenders_that_fit(computer: Computer) -> None:
    computer.become("linux-x86_64", "3.12")
    computer.add_module("linux-x86_64", "311")
    told = explain(ModuleNotFoundError(), manifest_of("linux-x64", "311", "313", "314"), computer.folder)
    assert told == (
        f"{BEGINNING}this Blender has Python 3.12, but there are engines only for Python 3.11, 3.13 and 3.14: use "
        "one of Blender 4.2 to 5.0 (Python 3.11) and Blender 5.1 and later (Python 3.13)"
    )


@pytest.mark.parametrize("module", ["macosx-11.0-arm64", "win-amd64", None])
def test_a_folder_without_a_module_for_this_python_is_named(computer: Computer, module: str | None) -> None:
    computer.become("macosx-11.0-arm64", "3.13")
    if module is not None:
        computer.add_module(module, "311")
    told = explain(ModuleNotFoundError("No module named 'perfect_bvh._core'"), {"version": "0.2.0"}, computer.folder)
    assert told == (
        f"{BEGINNING}{computer.folder} has no module for Python 3.13 on macOS on Apple silicon: "
        "install perfect_bvh-0.2.0-macos_arm64.zip"
    )


@pytest.mark.parametrize(
    ("manifest", "sentence"),
    [
        (
            manifest_of("windows-x64", "311"),
            "Blender has not installed it with the add-on: restart Blender, then install",
        ),
        ({"version": "0.2.0"}, "it is not part of the add-on's sources: install perfect_bvh-0.2.0-windows_x64.zip"),
    ],
)
def test_a_missing_engine_is_named(
    computer: Computer, monkeypatch: pytest.MonkeyPatch, manifest: dict[str, Any], sentence: str
) -> None:
    computer.become("win-amd64")
    monkeypatch.setattr(native_fault, "_engine_folder", lambda: None)
    assert sentence in explain(ModuleNotFoundError("No module named 'perfect_bvh'"), manifest)


@pytest.mark.parametrize("error", ["undefined symbol: PyType_Ready", "NumPy was built with baseline (X86_V2)"])
def test_what_the_system_says_is_told_as_it_is(computer: Computer, error: str) -> None:
    computer.become("linux-x86_64")
    computer.add_module("linux-x86_64")
    assert explain(ImportError(error), {"version": "0.2.0"}, computer.folder) == BEGINNING + error


def test_the_add_on_s_manifest_is_read() -> None:
    manifest = read_manifest()
    assert manifest["id"] == "perfect_bvh" and manifest["platforms"] and manifest["version"]


REAL = """
import json, sys
from perfect_bvh_addon.settings.native_fault import explain
try:
    import perfect_bvh
except ImportError as error:
    print(json.dumps(explain(error, {})))
"""


def test_an_engine_s_folder_of_another_system_is_really_explained(tmp_path: Path) -> None:
    """Python's own error, where nothing is faked but the folder."""
    package = tmp_path / "perfect_bvh"
    package.mkdir()
    (package / "__init__.py").write_text("from ._core import __version__\n")
    (package / "_core.cp39-win_amd64.pyd").touch()
    environment = environment_with_paths(tmp_path)
    command = [sys.executable, "-S", "-c", REAL]  # -S: an editable installation would find its own module first
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert f"{package} has no module for Python {sys.version_info[0]}.{sys.version_info[1]} on " in told
