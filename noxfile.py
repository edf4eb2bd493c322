"""Checks that run apart from one another: `nox` runs them all, `nox -s lint` one of them.

`tests` wants the system packages that the README names; `native_tests` and `sanitize` want g++ and libgtest-dev.
"""

from __future__ import annotations

import os
from pathlib import Path

import nox

nox.needs_version = ">=2024.4.15"
nox.options.error_on_missing_interpreters = True

# Pinned, so that a new release of a checker cannot fail a tree that has not changed.
RUFF = "ruff==0.17.5"
MYPY = "mypy==2.4.1"
CLANG_FORMAT = "clang-format==23.1.5"
EMBREEX = "embreex>=4.4"  # holds the library of Embree 4.4
BUILD_TOOLS = ("cmake>=3.25", "ninja>=1.11")

NATIVE_FOLDERS = ("native/src", "native/bindings", "native/tests", "native/benchmarks")
NATIVE_SUFFIXES = (".h", ".inl", ".cpp")


@nox.session
def lint(session: nox.Session) -> None:
    """Check style and types: ruff, mypy, clang-format."""
    session.install(RUFF, MYPY, CLANG_FORMAT, "numpy>=2")
    session.run("ruff", "check")
    session.run("ruff", "format", "--check")
    session.run("mypy")
    files = [path for folder in NATIVE_FOLDERS for path in sorted(Path(folder).rglob("*"))]
    session.run(
        "clang-format", "--dry-run", "-Werror", *(str(path) for path in files if path.suffix in NATIVE_SUFFIXES)
    )


@nox.session
def native_tests(session: nox.Session) -> None:
    """Build the C++ tests with assertions on and warnings as errors, and run them."""
    session.install(*BUILD_TOOLS)
    run_native_preset(session, "tests")


@nox.session
def sanitize(session: nox.Session) -> None:
    """Run the C++ tests under AddressSanitizer with UndefinedBehaviorSanitizer, then under ThreadSanitizer."""
    session.install(*BUILD_TOOLS)
    run_native_preset(session, "asan")
    run_native_preset(session, "tsan")


@nox.session(default=False)
def benchmarks(session: nox.Session) -> None:
    """Build the native benchmarks into build/benchmarks: tests/benchmarks/README.md says what they are for."""
    session.install(*BUILD_TOOLS, EMBREEX)
    headers = Path(os.environ.get("EMBREE_INCLUDE_DIR", "/usr/include"))
    if not (headers / "embree4" / "rtcore.h").is_file():
        session.error(f"{headers} has no embree4/rtcore.h: tests/benchmarks/README.md says how to get it")
    (library,) = Path(session.virtualenv.location).glob("lib/python*/site-packages/embreex.libs/libembree4*.so*")
    with session.chdir("native"):
        places = (f"-DEMBREE_INCLUDE_DIR={headers.resolve()}", f"-DEMBREE_LIBRARY={library.resolve()}")
        session.run("cmake", "--preset", "benchmarks", *places)
        session.run("cmake", "--build", "--preset", "benchmarks")


@nox.session
def tests(session: nox.Session) -> None:
    """Install the wheel with Blender's module and run the Python tests; arguments after `--` go to pytest."""
    session.install(".[blender,test]")
    session.run("pytest", *session.posargs)


def run_native_preset(session: nox.Session, preset: str) -> None:
    """Configure, build and test one preset of native/CMakePresets.json."""
    with session.chdir("native"):
        session.run("cmake", "--preset", preset)
        session.run("cmake", "--build", "--preset", preset)
        session.run("ctest", "--preset", preset)
