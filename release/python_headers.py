"""Fetches the files to compile for a CPython: headers and, on Windows, the import library of its DLL."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

import ziglang
from debian_packages import ARCHITECTURES, CACHE, RELEASES, unpack_packages
from import_library import make_import_library
from maven_pythons import unpack_python
from wheel_platforms import PLATFORMS

ZIG = Path(ziglang.__file__).resolve().parent / "zig"


@dataclass(frozen=True)
class Headers:
    """The files of one CPython for one platform."""

    root: Path  # the folder that all of that Python is below
    include: Path  # of Python.h
    library: Path | None = None  # to link with; other systems' Pythons are found when the module is loaded


def fetch_headers(python: str, platform: str) -> Headers:
    """The files of CPython `python` (such as 3.13) for `platform` (such as linux-arm64). Fetched into .cache once."""
    system = PLATFORMS[platform].system
    if system == "linux":
        root = fetch_linux_headers(python)
        return Headers(root, root / "include" / f"python{python}")
    if system == "macos":
        # One set for both processors: pyconfig.h asks the compiler which it is.
        root = unpack_python("macosx-x86_64", python)
        return Headers(root, root / "include" / f"python{python}")
    root = unpack_python("windows-x86_64", python)
    name = f"python{python.replace('.', '')}"
    library = root / "libs" / f"{name}.lib"
    if platform == "windows-arm64":
        library = root / "libs" / "arm64" / f"{name}.lib"
        make_import_library(ZIG, "arm64", root / f"{name}.dll", library)
    return Headers(root, root / "include", library)


def fetch_linux_headers(python: str) -> Path:
    """The folder usr of Debian's packages; files that differ between platforms are in the headers' folder for each."""
    folder = CACHE / "python_headers" / python
    include = folder / "usr" / "include"
    headers = include / f"python{python}"
    platforms = [f"{PLATFORMS[platform].processor}-linux-gnu" for platform in ARCHITECTURES]
    if not all((headers / platform).is_dir() for platform in platforms):
        shutil.rmtree(folder, ignore_errors=True)
        packages = [f"libpython{python}-dev:{architecture}" for architecture in ARCHITECTURES.values()]
        unpack_packages(folder, RELEASES[python], packages)
        # Debian's pyconfig.h includes one for each processor, from a neighbouring folder: put all below one folder.
        for platform in platforms:
            (include / platform).rename(headers / platform)
    return folder / "usr"
