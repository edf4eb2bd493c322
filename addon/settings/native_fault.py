"""Why the native engine cannot be loaded, and advice, for users: another system's zip, another Python.

Blender refuses to install most mismatches. Files that were copied by hand, kept over an update of Blender or shared
by two computers are handled here. Does not depend on Blender.
"""

from __future__ import annotations

import importlib.util
import platform
import re
import sys
import sysconfig
import tomllib
from collections.abc import Iterable
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import Any

# Blender's names of platforms, and what users call them.
NAMES = {
    "windows-x64": "Windows",
    "windows-arm64": "Windows on ARM",
    "macos-x64": "macOS on Intel",
    "macos-arm64": "macOS on Apple silicon",
    "linux-x64": "Linux",
    "linux-arm64": "Linux on ARM",
}
# The Python versions of Blender's official builds.
_BLENDERS = {"3.11": "Blender 4.2 to 5.0", "3.13": "Blender 5.1 and later"}
_PROCESSORS = {"amd64": "x64", "x86_64": "x64", "aarch64": "arm64"}
_SYSTEMS = {"win": "windows", "macosx": "macos"}
_WHEEL = re.compile(r"-cp(\d)(\d+)-[^-]+-[^-]+\.whl$")


def explain(error: BaseException, manifest: dict[str, Any], folder: Path | None = None) -> str:
    """Returns a sentence. error: of `import perfect_bvh`, quoted if its cause is unknown. manifest: our own.

    folder: of the package `perfect_bvh`, else the one that Python finds.
    """
    found = folder or _engine_folder()
    reason = (
        _of_another_platform(manifest)
        or _of_another_python(manifest)
        or (_missing(manifest) if found is None else _other_module(found, manifest))
        or str(error)
    )
    return f"The native engine could not be loaded: {reason}"


def read_manifest() -> dict[str, Any]:
    """The add-on's own, as its zip has it; empty if that was left out."""
    file = Path(__file__).parents[1] / "blender_manifest.toml"
    return tomllib.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}


def this_platform() -> str:
    """Returns the platform's name in Blender's manifests: the program's, not that of an emulating processor."""
    system, _, rest = sysconfig.get_platform().partition("-")
    processor = rest.rpartition("-")[2].lower()
    if processor == "universal2":
        processor = platform.machine().lower()
    return f"{_SYSTEMS.get(system, system)}-{_PROCESSORS.get(processor, processor)}"


def _python() -> str:
    return f"{sys.version_info[0]}.{sys.version_info[1]}"


def _of_another_platform(manifest: dict[str, Any]) -> str | None:
    """A zip is made for one platform, of which Blender's tool writes the name into it."""
    generated = manifest.get("build", {}).get("generated", {})
    platforms = generated.get("platforms", manifest.get("platforms"))
    if platforms is None or this_platform() in platforms:
        return None
    theirs, ours = _listed(map(_name, platforms)), _name(this_platform())
    return f"this add-on is for {theirs}, but this system is {ours}: {_way_out(manifest)}"


def _of_another_python(manifest: dict[str, Any]) -> str | None:
    wheels = manifest.get("build", {}).get("generated", {}).get("wheels", manifest.get("wheels"))
    pythons = [f"{match[1]}.{match[2]}" for wheel in wheels or () if (match := _WHEEL.search(wheel))]
    if not pythons or _python() in pythons:
        return None
    return (
        f"this Blender has Python {_python()}, but there are engines only for Python {_listed(sorted(set(pythons)))}: "
        f"use one of {_listed(f'{name} (Python {python})' for python, name in _BLENDERS.items())}"
    )


def _other_module(folder: Path, manifest: dict[str, Any]) -> str | None:
    """If the module in the engine's folder is another Python's or system's, or there is none."""
    if any((folder / f"_core{suffix}").is_file() for suffix in EXTENSION_SUFFIXES):
        return None
    return f"{folder} has no module for Python {_python()} on {_name(this_platform())}: {_way_out(manifest)}"


def _missing(manifest: dict[str, Any]) -> str:
    if manifest.get("wheels") or manifest.get("build", {}).get("generated"):
        return f"Blender has not installed it with the add-on: restart Blender, then {_way_out(manifest)}"
    return f"it is not part of the add-on's sources: {_way_out(manifest)}"


def _engine_folder() -> Path | None:
    try:
        found = importlib.util.find_spec("perfect_bvh")
    except ValueError:  # a replacement in this process that is no found module
        return None
    return None if found is None or found.origin is None else Path(found.origin).parent


def _way_out(manifest: dict[str, Any]) -> str:
    here = this_platform()
    if here not in NAMES:
        return "there is none for this system"
    return f"install perfect_bvh-{manifest.get('version', 'VERSION')}-{here.replace('-', '_')}.zip"


def _name(blender_platform: str) -> str:
    return NAMES.get(blender_platform, blender_platform)


def _listed(names: Iterable[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last
