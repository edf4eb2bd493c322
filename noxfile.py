"""Checks that run apart from one another: `nox` runs them, `nox -s lint` one of them, `nox -s soak` the long one.

`tests` wants the system packages that the README names; `native_tests` and `sanitize` want g++ and libgtest-dev;
`extension` and `arm64_pythons` want Debian, the first its binutils, and maven for other systems than Linux; `windows`
and `blenders` want root or sudo as well, the latter Python 3.11. `arm64` wants Debian's g++-aarch64-linux-gnu,
libgtest-dev and qemu-user-static.
"""

from __future__ import annotations

import os
import platform
import re
import shutil
import sys
from pathlib import Path

import nox

nox.needs_version = ">=2024.4.15"
nox.options.error_on_missing_interpreters = True

# Pinned, so that a new release of a checker cannot fail a tree that has not changed.
RUFF = "ruff==0.17.5"
MYPY = "mypy==2.4.1"
CLANG_FORMAT = "clang-format==23.1.5"
# Of .github/workflows: its form, and what makes such files unsafe.
WORKFLOW_LINTERS = ("check-jsonschema==0.39.0", "zizmor==1.32.0")
TWINE = "twine==7.0.0"
BUILD = "build==1.6.1"
TQDM = "tqdm==4.70.1"  # the command line's progress bar, in the zip
EMBREEX = "embreex>=4.4"  # holds the library of Embree 4.4
MATPLOTLIB = "matplotlib>=3.8"
BUILD_TOOLS = ("cmake>=3.25", "ninja>=1.11")
# One compiler for the wheels of all Pythons, and the Blender whose tools make the zip of them.
PYBIND11 = "pybind11==3.1.0"
WHEEL_TOOLS = (PYBIND11, "scikit-build-core==1.1.2", "ziglang==0.17.1")
BLENDER = "bpy==5.0.1"
OLDER_BLENDERS = ("bpy==4.2.23", "bpy==4.5.15")

QUICK_SECONDS = 30  # for tests; what follows a C++ change is compiled before that
# What takes any input to the engine through Python and back; small, for AddressSanitizer.
BOUNDARY_TESTS = (
    "tests/engine/check_sanitizer.py",
    "tests/engine/test_bad_input.py",
    "tests/engine/test_bulk.py",
    "tests/stress/test_fuzz.py",
)

NATIVE_FOLDERS = ("native/src", "native/bindings", "native/tests", "native/benchmarks")
NATIVE_SUFFIXES = (".h", ".inl", ".cpp")
# As Python names them: each has branches of its own, which types are checked in.
SYSTEMS = ("linux", "win32", "darwin")


@nox.session
def lint(session: nox.Session) -> None:
    """Check style and types, as each system has them: ruff, mypy, clang-format, and the workflows' linters."""
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


@nox.session(default=False, reuse_venv=True)
def types(session: nox.Session) -> None:
    """Check types alone: mypy, with the numpy that `lint` has, which is newer than that of Blender's module."""
    session.install(MYPY, "numpy>=2")
    session.run("mypy")


@nox.session(default=False, reuse_venv=True)
def quick(session: nox.Session) -> None:
    """Lint, then the tests near what differs from origin/main: within a minute, or two if C++ has changed.

    The first run takes as long as an installation. Tests that the time does not suffice for are skipped, by name.
    """
    sys.path.insert(0, "tests")
    import near

    changed = near.changed_files()
    session.install(RUFF, CLANG_FORMAT, *BUILD_TOOLS, *WHEEL_TOOLS[:2])
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
    """Run C++ and Python tests under AddressSanitizer with UndefinedBehaviorSanitizer, C++ under ThreadSanitizer."""
    session.install(*BUILD_TOOLS, PYBIND11, "numpy>=2", "pytest>=8")
    pybind11 = str(session.run("python", "-m", "pybind11", "--cmakedir", silent=True)).strip()
    python = Path(session.virtualenv.bin).resolve() / "python"
    run_native_preset(session, "asan", f"-Dpybind11_DIR={pybind11}", f"-DPython_EXECUTABLE={python}")
    run_sanitized_python_tests(session, Path("build/asan"))
    run_native_preset(session, "tsan")


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


@nox.session(default=False)
def wheel_tests(session: nox.Session) -> None:
    """Install the engine's wheel from dist/ that fits this system and Python, and run the Python tests on it.

    Nothing is compiled, so that this runs on any system: what `extension` built elsewhere is tried where it will be
    used. Arguments after `--` go to pytest.
    """
    project = nox.project.load_toml("pyproject.toml")["project"]
    extras = project["optional-dependencies"]
    session.install(*project["dependencies"], *extras["blender"], *extras["test"])
    session.install("--no-deps", "--no-index", "--find-links", "dist/wheels", "perfect-bvh-engine")
    asked = "import sysconfig; print(sysconfig.get_path('purelib'))"
    packages = Path(str(session.run("python", "-c", asked, silent=True)).strip())
    shutil.copytree("addon", packages / "perfect_bvh_addon", dirs_exist_ok=True)
    session.run("pytest", *session.posargs)


@nox.session(default=False)
def publish(session: nox.Session) -> None:
    """Upload what is in dist/ as the release of a tag, `-- v1.2.3`: wheels for pip, zips for Blender.

    Wants GitHub's `gh` and rights to both; a workflow has them by its identity. Stops before the first upload if the
    tag is not the version or a system's zip is missing.
    """
    if len(session.posargs) != 1:
        session.error("which tag? nox -s publish -- v1.2.3")
    (tag,) = session.posargs
    if tag != f"v{version()}":
        session.error(f"the tag {tag} is not that of version {version()} in addon/blender_manifest.toml")
    zips = [str(path) for path in sorted(Path("dist").glob(f"perfect_bvh-{version()}-*.zip"))]
    sys.path.insert(0, "native")
    from wheel_platforms import PLATFORMS

    if len(zips) != len(PLATFORMS):
        session.error(f"dist/ has {len(zips)} zips of version {version()}, not {len(PLATFORMS)}: nox -s extension")
    packages = [str(path) for path in sorted(Path("dist/wheels").glob(f"perfect_bvh_engine-{version()}*"))]
    session.install(TWINE)
    session.run("twine", "check", "--strict", *packages)
    session.run("twine", "upload", "--skip-existing", *packages)
    session.run("gh", "release", "create", tag, "--verify-tag", "--generate-notes", *zips, external=True)


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
def soak(session: nox.Session) -> None:
    """Edit scenes at random, 20,000 times unless told, and compare each synced one with Blender; may be resumed."""
    session.install(".[blender,test]")
    session.run("python", "tests/blender/soak_run.py", "--json", "tests/benchmarks/results/soak.json", *session.posargs)


@nox.session(default=False)
def fuzz(session: nox.Session) -> None:
    """Look for inputs that do something new or break something, for ten minutes unless told; keeps both."""
    session.install(".[test]")
    session.run("python", "tests/stress/fuzz.py", *(session.posargs or ("--seconds", "600")))


@nox.session(default=False)
def extension(session: nox.Session) -> None:
    """Build the engine's wheels in dist/wheels, and of them a zip in dist/ for each platform of Blender 4.2 and later.

    All platforms and Pythons, or those that stand behind `--`: `-- linux-x64 windows-x64:3.11` makes two zips, the
    second for one Python only.
    """
    session.install(*BUILD_TOOLS, *WHEEL_TOOLS, BLENDER)
    for built in Path("dist").glob("perfect_bvh-*.zip"):
        built.unlink()
    shutil.rmtree("dist/wheels", ignore_errors=True)
    chosen = ("--platform", *session.posargs) if session.posargs else ()
    session.run("python", "native/build_wheels.py", "dist/wheels", *chosen)
    shutil.rmtree("build/wheels", ignore_errors=True)
    shutil.copytree("dist/wheels", "build/wheels")
    session.run("python", "-m", "pip", "download", "--quiet", "--no-deps", TQDM, "--dest", "build/wheels")
    session.run("python", "native/extension_folder.py", "build/extension", "build/wheels")
    scripts = str(
        session.run("python", "-c", "import bpy; print(bpy.utils.system_resource('SCRIPTS'))", silent=True)
    ).splitlines()[-1]
    tool = f"{scripts}/addons_core/bl_pkg/cli/blender_ext.py"
    folders = ("--source-dir", "build/extension", "--output-dir", "dist")
    session.run("python", tool, "build", "--split-platforms", *folders)
    for built in sorted(Path("dist").glob("perfect_bvh-*.zip")):
        session.run("python", tool, "validate", str(built))


@nox.session(default=False)
def sdist(session: nox.Session) -> None:
    """Build source distributions: the engine's in dist/wheels, the whole project's in dist/."""
    session.install(BUILD, *WHEEL_TOOLS[:2])
    session.run("python", "native/engine_sources.py", "build/engine-sources")
    make = ("python", "-m", "build", "--sdist", "--no-isolation", "--outdir")
    session.run(*make, "dist/wheels", "build/engine-sources")
    session.run(*make, "dist", ".")


@nox.session(default=False)
def blenders(session: nox.Session) -> None:
    """Install what the zip is tried in: older modules of Blender into .cache/blenders, and a Blender with windows."""
    for release in OLDER_BLENDERS:
        folder = Path(".cache/blenders", release.partition("==")[2])
        session.run("python", "-m", "venv", "--clear", str(folder))
        session.run(str(folder / "bin" / "pip"), "install", "--quiet", release, external=True)
    session.run("tests/gui/blender_chroot.sh", "install", external=True)


@nox.session(default=False)
def arm64_pythons(session: nox.Session) -> None:
    """Unpack Pythons for 64-bit ARM into .cache/arm64_pythons, for tests/extension to try the zip's wheels in."""
    session.run("python", "native/arm64_pythons.py")


@nox.session(default=False)
def windows(session: nox.Session) -> None:
    """Try the zip in a real Blender with windows; screenshots are left in .cache/windows."""
    session.run("tests/gui/windows.sh", str(extension_zip()), external=True)


@nox.session(default=False)
def windows_wheel(session: nox.Session) -> None:
    """Try the wheel and the zip for Windows under Wine, beside the same on Linux, which takes hours.

    `-- short` is what needs no Blender and no more than four minutes; `-- images command_line` are two steps by name,
    which tests/wine/try_wheel.py lists. `nox -s extension -- windows-x64` builds what is tried.
    """
    wheels = sorted(Path("dist/wheels").glob("*-cp311-win_amd64.whl"))
    if not wheels:
        session.error("no wheel for Windows in dist/wheels: `nox -s extension -- windows-x64` builds it")
    session.install("numpy>=1.26" if session.posargs == ["short"] else ".[blender]")
    session.run("python", "tests/wine/try_wheel.py", str(wheels[-1]), *session.posargs)


def is_installed(session: nox.Session, package: str) -> bool:
    """Whether the session's environment has it from an earlier run."""
    return any(Path(session.virtualenv.location).glob(f"lib/python*/site-packages/{package}*"))


def version() -> str:
    """The manifest's."""
    manifest = Path("addon/blender_manifest.toml").read_text(encoding="utf-8")
    (found,) = re.findall(r'^version = "(.+)"$', manifest, re.MULTILINE)
    return str(found)


def extension_zip() -> Path:
    """The zip for Blender on this machine, where Linux's windows are tried."""
    machine = "arm64" if platform.machine() == "aarch64" else "x64"
    return Path("dist") / f"perfect_bvh-{version()}-linux_{machine}.zip"


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
    # First of all: it replaces malloc. The C++ library beside it, or it finds no exceptions to follow.
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
