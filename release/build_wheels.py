"""Builds the engine's wheels for Blender's platforms and for the Pythons that its releases carry.

python release/build_wheels.py OUTPUT_FOLDER [--platform linux-x64 windows-x64:3.11,3.13 ...] [--python 3.11 ...]

One compiler, ziglang's, builds all of them on any machine, reproducibly to the byte. Each Python contributes only its
headers and, on Windows, its import library: python_headers.py fetches them into .cache, without installing anything.
The interpreter that runs this must have cmake, ninja, pip, pybind11, scikit-build-core, ziglang and zopflipy; the
system must have apt-get, dpkg and binutils, and maven for other platforms than Linux.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import zopfli
from debian_packages import CACHE
from python_headers import ZIG, Headers, fetch_headers
from weak_symbols import check_kernels
from wheel_platforms import PLATFORMS, PYTHONS, gather_pythons, read_platform

REPOSITORY = Path(__file__).resolve().parent.parent
NATIVE = REPOSITORY / "native"
# As many platforms at a time: more would only wait for memory and for one another.
PLATFORMS_AT_ONCE = 2
# The time that a wheel says its files are of: the first that a zip can.
DATE = "315532800"


def build_wheel(python: str, name: str, headers: Headers, output: Path) -> None:
    """Build the wheel for one CPython, for example 3.13, on the platform of that name into `output`."""
    platform = PLATFORMS[name]
    # A platform's builds share one folder, so that only the bindings are compiled for each; CMake's findings about the
    # last Python are removed.
    build = REPOSITORY / "build" / f"engine-{name}"
    (build / "CMakeCache.txt").unlink(missing_ok=True)
    defines = {
        "CMAKE_TOOLCHAIN_FILE": NATIVE / "cmake" / "zig.cmake",
        "Python_FIND_STRATEGY": "LOCATION",
        "Python_ROOT_DIR": headers.root,
        "Python_INCLUDE_DIR": headers.include,
        "PYTHON_MODULE_EXTENSION": platform.module_suffix.format(python.replace(".", "")),
        "PYTHON_MODULE_DEBUG_POSTFIX": "",
        "PYTHON_IS_DEBUG": "0",
        "PYBIND11_USE_CROSSCOMPILING": "ON",  # the interpreter that runs CMake is another one
    }
    if headers.library:
        defines["Python_LIBRARY"] = headers.library
    settings = {
        "build-dir": build,
        "cmake.python-hints": "false",
        "install.strip": "false",  # the linker has done so; this machine's `strip` knows other systems' files badly
        "wheel.tags": platform.tag(python),
    } | {f"cmake.define.{key}": value for key, value in defines.items()}
    environment = os.environ | {
        "SOURCE_DATE_EPOCH": os.environ.get("SOURCE_DATE_EPOCH", DATE),
        "ZIG": str(ZIG),
        "ZIG_PYTHON": sys.executable,
        "ZIG_TARGET": platform.target,
        "ZIG_GLOBAL_CACHE_DIR": str(CACHE / f"zig-{name}"),
        "ZIG_LOCAL_CACHE_DIR": str(CACHE / f"zig-{name}"),
    }
    pip = (sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "-w", str(output))
    options = (f"-C{key}={value}" for key, value in settings.items())
    subprocess.run([*pip, *options, str(NATIVE)], check=True, env=environment)
    if platform.system != "linux" and platform.processor == "x86_64":  # NEON is on every 64-bit ARM
        check_kernels(build)


def pack_tightly(wheel: Path) -> None:
    """Packs a wheel's files into 4 % less, in seconds. Their contents, dates and order stay."""
    packed = wheel.with_suffix(".packed")
    with zipfile.ZipFile(wheel) as source, zopfli.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, iterations=1) as target:
        for entry in source.infolist():
            target.writestr(entry, source.read(entry))
    packed.replace(wheel)


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Build the engine's wheels for Blender's extension.")
    parser.add_argument("output", type=Path, help="folder for the wheels")
    parser.add_argument(
        "--platform",
        nargs="+",
        type=read_platform,
        default=[(name, ()) for name in PLATFORMS],
        help="linux-x64 say, or windows-x64:3.11,3.13 for these Pythons only; all unless told",
    )
    parser.add_argument("--python", nargs="+", default=list(PYTHONS), choices=PYTHONS)
    arguments = parser.parse_args()
    # Fetch everything before the first compiles: apt's and Maven's folders are shared, and failures show at once.
    headers = {
        name: {python: fetch_headers(python, name) for python in pythons}
        for name, pythons in gather_pythons(arguments.platform, tuple(arguments.python)).items()
    }

    def build_platform(name: str) -> None:
        for python, found in headers[name].items():
            build_wheel(python, name, found, arguments.output)

    # In parallel, to use cores that would be idle during CMake's checks of the compiler and during linking.
    with ThreadPoolExecutor(PLATFORMS_AT_ONCE) as pool:
        list(pool.map(build_platform, headers))
        list(pool.map(pack_tightly, sorted(arguments.output.glob("*.whl"))))


if __name__ == "__main__":
    main()
