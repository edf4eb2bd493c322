"""Unpacks CPython and numpy for 64-bit ARM, of the Pythons that Blender releases carry, for an emulator to run.

python release/arm64_pythons.py

They go into .cache/arm64_pythons, without installing anything: a folder for each Python, as a root directory of that
machine (`qemu-aarch64-static -L FOLDER FOLDER/usr/bin/python3.13`), and its numpy in FOLDER/packages.
"""

from __future__ import annotations

import shutil
import subprocess
import sys

from debian_packages import CACHE, RELEASES, unpack_packages

# Packages that CPython, and numpy, need on a bare machine.
LIBRARIES = ("libc6", "libexpat1", "libffi8", "libgcc-s1", "libstdc++6", "zlib1g")
PARTS_OF_PYTHON = ("libpython{}-minimal", "libpython{}-stdlib", "python{}-minimal")
NUMPY_PLATFORMS = ("manylinux2014_aarch64", "manylinux_2_27_aarch64", "manylinux_2_28_aarch64")


def unpack_python(python: str) -> None:
    """One CPython, for example 3.13, as a root directory with numpy."""
    folder = CACHE / "arm64_pythons" / python
    shutil.rmtree(folder, ignore_errors=True)
    names = (*LIBRARIES, *(part.format(python) for part in PARTS_OF_PYTHON))
    unpack_packages(folder, RELEASES[python], [f"{name}:arm64" for name in names])
    # Where the loader of shared libraries is looked for; newer packages count on the link being there.
    if not (folder / "lib").exists():
        (folder / "lib").symlink_to("usr/lib")
    platforms = (f"--platform={platform}" for platform in NUMPY_PLATFORMS)
    which = ("--only-binary=:all:", "--no-deps", f"--python-version={python}", *platforms)
    pip = (sys.executable, "-m", "pip", "install", "--quiet", *which, "--target", str(folder / "packages"))
    subprocess.run([*pip, "numpy>=1.26"], check=True)


if __name__ == "__main__":
    for version in RELEASES:
        unpack_python(version)
