"""Builds the engine's wheels for the Pythons that Blender releases carry: Linux on x86-64, glibc 2.28 and later.

python native/build_wheels.py OUTPUT_FOLDER

One compiler, ziglang's, builds all of them on any machine. Of each Python nothing but its headers is needed: they are
unpacked from Debian's packages into .cache, without installing anything. The interpreter that runs this must have
cmake, ninja, pip, pybind11, scikit-build-core and ziglang; the system must have apt-get, dpkg and binutils.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import ziglang

NATIVE = Path(__file__).resolve().parent
CACHE = NATIVE.parent / ".cache"
# Python and the Debian release that has its headers: Blender 4.2 to 5.0, Blender 5.1 and later, Debian's Blender.
DEBIAN_RELEASES = {"3.11": "bookworm", "3.13": "trixie", "3.14": "sid"}
KEYRING = "/usr/share/keyrings/debian-archive-keyring.gpg"


def run(*command: str | Path, cwd: Path | None = None, environment: Mapping[str, str] | None = None) -> None:
    """Run a command; a failure ends the build."""
    subprocess.run([str(part) for part in command], check=True, cwd=cwd, env=environment)


def debian_mirror() -> str:
    """The mirror that this machine's own packages come from."""
    for path in (Path("/etc/apt/sources.list.d/debian.sources"), Path("/etc/apt/sources.list")):
        if not path.is_file():
            continue
        for line in path.read_text(encoding="utf-8").splitlines():
            words = line.split()
            if words[:1] == ["URIs:"] or words[:1] == ["deb"]:
                addresses = [word for word in words[1:] if "://" in word]
                if addresses:
                    return addresses[0]
    raise SystemExit("build_wheels: no Debian mirror in /etc/apt: cannot fetch Python's headers")


def fetch_headers(python: str) -> Path:
    """The folder of Python.h, unpacked from Debian's package by an apt of our own that touches no system file."""
    folder = CACHE / "python_headers" / python
    headers = folder / "usr" / "include" / f"python{python}"
    architecture = folder / "usr" / "include" / "x86_64-linux-gnu"
    if headers.is_dir() and not architecture.exists():
        return headers
    (folder / "lists" / "partial").mkdir(parents=True, exist_ok=True)
    (folder / "status").touch()
    release = DEBIAN_RELEASES[python]
    sources = folder / "sources.list"
    sources.write_text(f"deb [arch=amd64 signed-by={KEYRING}] {debian_mirror()} {release} main\n", encoding="utf-8")
    options = {
        "Dir::Etc::SourceList": sources,
        "Dir::Etc::SourceParts": "/dev/null",
        "Dir::State::Lists": folder / "lists",
        "Dir::State::Status": folder / "status",
        "Dir::Cache": folder,
        "APT::Architecture": "amd64",
        "APT::Sandbox::User": "",
        "Acquire::Check-Valid-Until": "false",
        "Acquire::Languages": "none",
    }
    apt = ["apt-get", "-qq", *(f"-o{name}={value}" for name, value in options.items())]
    run(*apt, "update")
    run(*apt, "download", f"libpython{python}-dev", cwd=folder)
    (package,) = folder.glob("*.deb")
    run("dpkg", "-x", package, folder)
    package.unlink()
    # Debian's pyconfig.h includes one for each architecture, from beside the folder: have all below one.
    architecture.rename(headers / architecture.name)
    return headers


def build_wheel(python: str, output: Path) -> None:
    """The wheel for one CPython, 3.13 say, into `output`."""
    headers = fetch_headers(python)
    tag = "cp" + python.replace(".", "")
    # All share one folder, so that only the bindings are compiled for each; what CMake found of the last Python goes.
    build = NATIVE.parent / "build" / "engine"
    (build / "CMakeCache.txt").unlink(missing_ok=True)
    defines = {
        "CMAKE_TOOLCHAIN_FILE": NATIVE / "cmake" / "zig-linux-x64.cmake",
        "Python_FIND_STRATEGY": "LOCATION",
        "Python_ROOT_DIR": headers.parent.parent,
        "Python_INCLUDE_DIR": headers,
        "PYTHON_MODULE_EXTENSION": f".cpython-{python.replace('.', '')}-x86_64-linux-gnu.so",
        "PYTHON_MODULE_DEBUG_POSTFIX": "",
        "PYTHON_IS_DEBUG": "0",
        "PYBIND11_USE_CROSSCOMPILING": "ON",  # the interpreter that runs CMake is another one
    }
    settings = {
        "build-dir": build,
        "cmake.python-hints": "false",
        "wheel.tags": f"{tag}-{tag}-manylinux_2_28_x86_64",
    } | {f"cmake.define.{name}": value for name, value in defines.items()}
    environment = os.environ | {
        "ZIG": str(Path(ziglang.__file__).parent / "zig"),
        "ZIG_GLOBAL_CACHE_DIR": str(CACHE / "zig"),
        "ZIG_LOCAL_CACHE_DIR": str(CACHE / "zig"),
    }
    run(
        *(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "-w", output),
        *(f"-C{name}={value}" for name, value in settings.items()),
        NATIVE,
        environment=environment,
    )


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Build the engine's wheels for Blender's extension.")
    parser.add_argument("output", type=Path, help="folder for the wheels")
    parser.add_argument("--python", nargs="+", default=list(DEBIAN_RELEASES), choices=list(DEBIAN_RELEASES))
    arguments = parser.parse_args()
    for python in arguments.python:
        build_wheel(python, arguments.output)


if __name__ == "__main__":
    main()
