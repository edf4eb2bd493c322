"""Checks as sessions: `.ci/run` runs those of each change, `nox -s release_check` those of a release.

`tests` needs the system packages that the README names; `native_tests`, `sanitize`, `threads` and `counted_work` need
g++ and libgtest-dev; `windows` and `blenders` need Debian with root or sudo, the latter Python 3.11. `arm64` needs
Debian's g++-aarch64-linux-gnu, libgtest-dev and qemu-user-static. The sessions that make and try wheels and zips are in
release/sessions.py.
"""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import nox

sys.path.insert(0, str(Path(__file__).resolve().parent / "release"))
from sessions import BUILD_BACKEND, BUILD_TOOLS, PYBIND11, copy_addon, extension_zip, install_engine

nox.needs_version = ">=2024.4.15"
nox.options.error_on_missing_interpreters = True

# Pinned, so that a new release of a checker cannot fail a tree that has not changed.
RUFF = "ruff==0.17.5"
MYPY = "mypy==2.4.1"
CLANG_FORMAT = "clang-format==23.1.5"
# Check .github/workflows: the schema, and security.
WORKFLOW_LINTERS = ("check-jsonschema==0.39.0", "zizmor==1.32.0")
EMBREEX = "embreex>=4.4"  # holds the library of Embree 4.4
SITE = ("mkdocs-material==9.8.2", "mkdocstrings-python==2.0.11", RUFF)
MATPLOTLIB = "matplotlib>=3.8"
OLDER_BLENDERS = ("bpy==4.2.23", "bpy==4.5.15")

QUICK_SECONDS = 30  # for tests; the build after a C++ change comes before and is extra
# Tests of any input to the engine through Python and back; small, for AddressSanitizer.
BOUNDARY_TESTS = (
    "tests/engine/check_sanitizer.py",
    "tests/engine/test_bad_curves_and_points.py",
    "tests/engine/test_bad_input.py",
    "tests/engine/test_bulk.py",
    "tests/engine/test_nodes.py",
    "tests/stress/test_fuzz.py",
)

TRIMESH = "5.2.0"  # whose tests are run
# The slowest files of tests/engine that test the compiled engine; other tests cover the passing of arrays.
NUMPY_FREE_TESTS = (
    "adaptive_sampling",
    "calibration",
    "curve_kinds",
    "cyclic_curves",
    "exact_hits",
    "oracle",
    "preview_lights",
    "processors",
    "render_lens",
    "shutter",
    "times",
)

NATIVE_FOLDERS = ("native/src", "native/bindings", "native/tests", "native/benchmarks")
NATIVE_SUFFIXES = (".h", ".inl", ".cpp")
# Python's names: each system has its own branches, whose types are checked.
SYSTEMS = ("linux", "win32", "darwin")


@nox.session
def lint(session: nox.Session) -> None:
    """Check style, types and words by ruff, mypy for each system, clang-format and others; print lines by folder."""
    session.install(RUFF, MYPY, CLANG_FORMAT, "numpy>=2", *WORKFLOW_LINTERS)
    session.run("ruff", "check")
    session.run("ruff", "format", "--check")
    for system in SYSTEMS:
        session.run("mypy", "--platform", system, "--cache-dir", f".mypy_cache/{system}")
    files = [path for folder in NATIVE_FOLDERS for path in sorted(Path(folder).rglob("*"))]
    session.run(
        "clang-format", "--dry-run", "-Werror", *(str(path) for path in files if path.suffix in NATIVE_SUFFIXES)
    )
    workflows = [str(path) for path in sorted(Path(".github/workflows").glob("*.yml"))]
    session.run("check-jsonschema", "--builtin-schema", "vendor.github-workflows", *workflows)
    session.run("zizmor", "--offline", "--no-progress", *workflows)
    session.run("python", "tests/plain_words.py")
    session.run("python", "tests/rooms.py")


@nox.session(default=False, reuse_venv=True)
def types(session: nox.Session) -> None:
    """Check types alone: mypy, with the numpy that `lint` has, which is newer than that of Blender's module."""
    session.install(MYPY, "numpy>=2")
    session.run("mypy")


@nox.session(default=False, reuse_venv=True)
def quick(session: nox.Session) -> None:
    """Lint, then run the tests near the changes since origin/main: within a minute, or two if C++ has changed.

    The first run takes as long as an installation. Tests that do not fit into the time are skipped, and named.
    """
    sys.path.insert(0, "tests")
    import near

    changed = near.changed_files()
    session.install(RUFF, CLANG_FORMAT, *BUILD_TOOLS, *BUILD_BACKEND)
    session.run("ruff", "check")
    session.run("ruff", "format", "--check")
    native = [path for path in changed if path.startswith("native/") and path.endswith(NATIVE_SUFFIXES)]
    if native:
        session.run("clang-format", "--dry-run", "-Werror", *native)
        suites = ":".join(f"*{suite}*" for suite in near.near_native_suites(changed))
        with session.chdir("native"):
            session.run("cmake", "--preset", "tests", silent=True)
            session.run("cmake", "--build", "--preset", "tests")
        session.run("build/tests/perfect_bvh_tests", f"--gtest_filter={suites or 'none'}", external=True)
    editable = (
        "--no-build-isolation",
        "-Cbuild-dir=build/editable",
        "-Ceditable.rebuild=true",
        "-e",
        ".[blender,test]",
    )
    if not Path("build/editable/CMakeCache.txt").is_file() or not is_installed(session, "perfect_bvh"):
        session.install(*editable)
        (site,) = Path(session.virtualenv.location).glob("lib/python*/site-packages")
        (site / "perfect_bvh_addon").unlink(missing_ok=True)
        (site / "perfect_bvh_addon").symlink_to(Path("addon").resolve())
    session.notify("types")
    tests = near.near_python_tests(changed)
    session.run("pytest", "-n", "0", "-q", f"--seconds={QUICK_SECONDS}", *tests)


@nox.session
def native_tests(session: nox.Session) -> None:
    """Build the C++ tests with assertions on and warnings as errors, and run them."""
    session.install(*BUILD_TOOLS)
    run_native_preset(session, "tests")


@nox.session
def sanitize(session: nox.Session) -> None:
    """Run C++ tests and those of the Python boundary under AddressSanitizer and UndefinedBehaviorSanitizer.

    `-- all` compiles the kernels for AVX-512 as well, where the preset leaves them out.
    """
    session.install(*BUILD_TOOLS, PYBIND11, "numpy>=2", "pytest>=8")
    pybind11 = str(session.run("python", "-m", "pybind11", "--cmakedir", silent=True)).strip()
    python = Path(session.virtualenv.bin).resolve() / "python"
    options = ("-DPERFECT_BVH_LEFT_OUT_ISAS=",) if session.posargs == ["all"] else ()
    run_native_preset(session, "asan", f"-Dpybind11_DIR={pybind11}", f"-DPython_EXECUTABLE={python}", *options)
    run_sanitized_python_tests(session, Path("build/asan"))


@nox.session(default=False)
def threads(session: nox.Session) -> None:
    """Run the C++ tests that start threads under ThreadSanitizer."""
    session.install(*BUILD_TOOLS)
    run_native_preset(session, "tsan")


@nox.session(default=False)
def counted_work(session: nox.Session) -> None:
    """Count the work that long calls do between two checks for a cancellation."""
    session.install(*BUILD_TOOLS)
    run_native_preset(session, "work")


@nox.session(default=False)
def arm64(session: nox.Session) -> None:
    """Build the C++ tests for 64-bit ARM and run them under an emulator, which takes about half an hour."""
    session.install(*BUILD_TOOLS)
    with session.chdir("native"):
        toolchain = ("--toolchain", str(Path("cmake/debian-linux-arm64.cmake").resolve()))
        build = Path("../build/arm64-googletest").resolve()
        places = ("-S", "/usr/src/googletest", "-B", str(build), f"-DCMAKE_INSTALL_PREFIX={build / 'installed'}")
        session.run("cmake", "-G", "Ninja", *toolchain, *places, "-DBUILD_GMOCK=OFF")
        session.run("cmake", "--build", str(build), "--target", "install")
    run_native_preset(session, "arm64")


@nox.session(default=False)
def benchmarks(session: nox.Session) -> None:
    """Build the native benchmarks into build/benchmarks: tests/benchmarks/README.md explains them."""
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


@nox.session(default=False)
def numpy2(session: nox.Session) -> None:
    """Run tests of the engine and of the synchronisation with numpy 2, which Blender has from 5.1 on.

    On the wheel in dist/wheels, which `nox -s extension -- linux-x64:3.11` builds. NUMPY_FREE_TESTS are left out.
    """
    session.install("numpy>=2", "hypothesis>=6", "pytest>=8", "pytest-xdist>=3.8", "trimesh>=4.5")
    install_engine(session)
    copy_addon(session)
    left_out = (f"--ignore=tests/engine/test_{name}.py" for name in NUMPY_FREE_TESTS)
    session.run("pytest", *(session.posargs or ("tests/engine", "tests/sync", *left_out)))


@nox.session(default=False)
def charts(session: nox.Session) -> None:
    """Draw tests/charts/pictures from tests/charts/data; with `-- --measure [NAME ...]` measure again before that."""
    if session.posargs[:1] == ["--measure"]:
        session.install(".[blender,bench]")
        session.run("python", "tests/charts/measure.py", *session.posargs[1:])
        session.run("python", "tests/charts/make.py")
    else:
        session.install(MATPLOTLIB)
        session.run("python", "tests/charts/make.py", *session.posargs)


@nox.session(default=False)
def docs(session: nox.Session) -> None:
    """Build the site into build/site; any warning is an error. `nox -s docs -- serve` shows it while it is written.

    The gallery's pictures are made by running all examples.
    """
    session.install(".[blender,trimesh]", *SITE)
    session.run("python", "release/site_sources.py", "build/site-sources", "build/site-packages")
    session.run("python", "release/gallery.py", "build/site-sources/gallery")
    session.run("mkdocs", *(session.posargs or ("build",)), env={"NO_MKDOCS_2_WARNING": "1"})


@nox.session(default=False)
def soak(session: nox.Session) -> None:
    """Edit scenes at random, 20,000 times by default, and compare each synced one with Blender; may be resumed."""
    session.install(".[blender,test]")
    session.run("python", "tests/blender/soak_run.py", "--json", "tests/benchmarks/results/soak.json", *session.posargs)


@nox.session(default=False)
def fuzz(session: nox.Session) -> None:
    """Search for inputs that show new behaviour or break something, for ten minutes by default; keeps both."""
    session.install(".[test]")
    session.run("python", "tests/stress/fuzz.py", *(session.posargs or ("--seconds", "600")))


@nox.session(default=False)
def blenders(session: nox.Session) -> None:
    """Install the Blenders to test the zip in: older modules into .cache/blenders, and a Blender with windows.

    `-- windows` installs the latter alone.
    """
    for release in () if session.posargs == ["windows"] else OLDER_BLENDERS:
        folder = Path(".cache/blenders", release.partition("==")[2])
        session.run("python", "-m", "venv", "--clear", str(folder))
        session.run(str(folder / "bin" / "pip"), "install", "--quiet", release, external=True)
    session.run("tests/gui/blender_chroot.sh", "install", external=True)


@nox.session(default=False)
def windows(session: nox.Session) -> None:
    """Try the zip in a real Blender with windows; screenshots are left in .cache/windows.

    All steps of tests/gui/steps.py, or those named: `-- enable scan`, `-- main` for the ones that matter most.
    """
    session.run(
        "tests/gui/windows.sh", str(extension_zip()), external=True, env={"WINDOWS_STEPS": ",".join(session.posargs)}
    )


@nox.session(default=False)
def trimesh_tests(session: nox.Session) -> None:
    """Run trimesh's own tests of rays with our intersector; arguments after `--` go to pytest."""
    session.install(
        ".[test]", f"trimesh=={TRIMESH}", *["manifold3d", "networkx", "pyinstrument", "rtree", "scipy", "shapely"]
    )
    folder = Path(".cache/trimesh") / TRIMESH
    if not folder.is_dir():
        address = "https://github.com/mikedh/trimesh"
        session.run("git", "clone", "-q", "--depth=1", f"--branch={TRIMESH}", address, str(folder), external=True)
    session.run("python", "tests/stress/trimesh_tests.py", str(folder), *session.posargs)


@nox.session(default=False)
def farm_killer(session: nox.Session) -> None:
    """Kill processes of the farm at random, a hundred times by default, and compare its output."""
    session.install(".[blender,test]")
    session.run("python", "tests/blender/farm_killer.py", *session.posargs, env={"PYTHONPATH": "tests"})


@nox.session(default=False)
def release_check(session: nox.Session) -> None:
    """Run the tests that are too slow for each change: hours of two cores, all of them before a release.

    Needs Debian 12 with root or sudo, and its packages binutils, debootstrap, g++, g++-aarch64-linux-gnu, libgtest-dev,
    maven, procps, python3-dev, python3-venv, qemu-user-static, wine64 and those of the README.
    """
    sessions: tuple[tuple[str, list[str]], ...] = (
        ("sanitize", ["all"]),
        ("threads", []),
        ("counted_work", []),
        ("blenders", []),
        ("arm64_pythons", []),
        ("extension", ["windows-x64:3.11", "linux-x64", "linux-arm64:3.13"]),
        ("windows_wheel", ["short"]),
        ("windows", []),
        ("tests", ["--long", "--live-cycles"]),
        ("trimesh_tests", []),
        ("farm_killer", []),
        ("soak", []),
        ("arm64", []),
    )
    for name, arguments in sessions:
        session.notify(name, arguments)


def is_installed(session: nox.Session, package: str) -> bool:
    """Whether the session's environment has it from an earlier run."""
    return any(Path(session.virtualenv.location).glob(f"lib/python*/site-packages/{package}*"))


def run_native_preset(session: nox.Session, preset: str, *options: str) -> None:
    """Configure, build and test one preset of native/CMakePresets.json."""
    with session.chdir("native"):
        session.run("cmake", "--preset", preset, *options)
        session.run("cmake", "--build", "--preset", preset)
        session.run("ctest", "--preset", preset)


def run_sanitized_python_tests(session: nox.Session, build: Path) -> None:
    """Run BOUNDARY_TESTS with the sources' Python package and the module that AddressSanitizer was built into."""
    package = build / "python" / "perfect_bvh"
    shutil.rmtree(package, ignore_errors=True)
    shutil.copytree("native/python/perfect_bvh", package, ignore=shutil.ignore_patterns("__pycache__", "*.so"))
    (module,) = build.glob("_core.*.so")
    shutil.copy(module, package)
    # libasan must be first because it replaces malloc. Without the C++ library it cannot intercept exceptions.
    libraries = [
        str(session.run("g++", f"-print-file-name={name}", silent=True, external=True)).strip()
        for name in ("libasan.so", "libstdc++.so")
    ]
    environment = {
        "LD_PRELOAD": " ".join(libraries),
        "ASAN_OPTIONS": "detect_leaks=0",  # Python itself leaves much behind at its end
        "PYTHONMALLOC": "malloc",  # or small objects share blocks, in which an overrun goes unnoticed
        "PYTHONPATH": str(package.parent.resolve()),
        "PERFECT_BVH_FUZZ_SECONDS": "2",
    }
    session.run("python", "-m", "pytest", "-o", "addopts=--import-mode=importlib", *BOUNDARY_TESTS, env=environment)


@nox.session(default=False)
def cycles_images(session: nox.Session) -> None:
    """Render the images of Cycles that tests compare with into tests/cycles_images; of some files: `-- FILE ...`."""
    session.install(".[blender,test]")
    session.run("pytest", "-n", "0", "--record-cycles", *(session.posargs or ["tests/blender"]))
