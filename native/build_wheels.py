"""Builds the engine's wheels for the Pythons that Blender releases carry: Linux, x86-64 and ARM, glibc 2.28 and later.

python native/build_wheels.py OUTPUT_FOLDER

One compiler, ziglang's, builds all of them on any machine. Of each Python nothing but its headers is needed: they are
unpacked from Debian's packages into .cache, without installing anything. The interpreter that runs this must have
cmake, ninja, pip, pybind11, scikit-build-core and ziglang; the system must have apt-get, dpkg and binutils.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import ziglang
from debian_packages import ARCHITECTURES, CACHE, RELEASES, unpack_packages

NATIVE = Path(__file__).resolve().parent
# What compilers call the processor of Blender's platforms.
PROCESSORS = {"linux-x64": "x86_64", "linux-arm64": "aarch64"}


def fetch_headers(python: str) -> Path:
    """The folder of Python.h, unpacked from Debian's packages; what differs between platforms is in it for each."""
    folder = CACHE / "python_headers" / python
    include = folder / "usr" / "include"
    headers = include / f"python{python}"
    platforms = [f"{processor}-linux-gnu" for processor in PROCESSORS.values()]
    if not all((headers / platform).is_dir() for platform in platforms):
        shutil.rmtree(folder, ignore_errors=True)
        packages = [f"libpython{python}-dev:{architecture}" for architecture in ARCHITECTURES.values()]
        unpack_packages(folder, RELEASES[python], packages)
        # Debian's pyconfig.h includes one for each processor, from beside the folder: have all below one.
        for platform in platforms:
            (include / platform).rename(headers / platform)
    return headers


def build_wheel(python: str, platform: str, output: Path) -> None:
    """The wheel for one CPython, 3.13 say, on one platform, linux-arm64 say, into `output`."""
    headers = fetch_headers(python)
    tag = "cp" + python.replace(".", "")
    processor = PROCESSORS[platform]
    # A platform's share one folder, so that only the bindings are compiled for each; what CMake found of the last
    # Python goes.
    build = NATIVE.parent / "build" / f"engine-{platform}"
    (build / "CMakeCache.txt").unlink(missing_ok=True)
    defines = {
        "CMAKE_TOOLCHAIN_FILE": NATIVE / "cmake" / "zig-linux.cmake",
        "Python_FIND_STRATEGY": "LOCATION",
        "Python_ROOT_DIR": headers.parent.parent,
        "Python_INCLUDE_DIR": headers,
        "PYTHON_MODULE_EXTENSION": f".cpython-{python.replace('.', '')}-{processor}-linux-gnu.so",
        "PYTHON_MODULE_DEBUG_POSTFIX": "",
        "PYTHON_IS_DEBUG": "0",
        "PYBIND11_USE_CROSSCOMPILING": "ON",  # the interpreter that runs CMake is another one
    }
    settings = {
        "build-dir": build,
        "cmake.python-hints": "false",
        "wheel.tags": f"{tag}-{tag}-manylinux_2_28_{processor}",
    } | {f"cmake.define.{name}": value for name, value in defines.items()}
    environment = os.environ | {
        "ZIG": str(Path(ziglang.__file__).parent / "zig"),
        "ZIG_PROCESSOR": processor,
        "ZIG_GLOBAL_CACHE_DIR": str(CACHE / f"zig-{platform}"),
        "ZIG_LOCAL_CACHE_DIR": str(CACHE / f"zig-{platform}"),
    }
    pip = (sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "-w", str(output))
    options = (f"-C{name}={value}" for name, value in settings.items())
    subprocess.run([*pip, *options, str(NATIVE)], check=True, env=environment)


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Build the engine's wheels for Blender's extension.")
    parser.add_argument("output", type=Path, help="folder for the wheels")
    parser.add_argument("--python", nargs="+", default=list(RELEASES), choices=list(RELEASES))
    parser.add_argument("--platform", nargs="+", default=list(PROCESSORS), choices=list(PROCESSORS))
    arguments = parser.parse_args()
    for python in arguments.python:
        fetch_headers(python)

    def build_platform(platform: str) -> None:
        for python in arguments.python:
            build_wheel(python, platform, arguments.output)

    # Side by side, for what cores would be idle in: CMake's questions to the compiler, and linking.
    with ThreadPoolExecutor() as pool:
        list(pool.map(build_platform, arguments.platform))


if __name__ == "__main__":
    main()
