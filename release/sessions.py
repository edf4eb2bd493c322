"""The sessions that build, test and publish releases; noxfile.py has those that check the sources.

`extension` and `arm64_pythons` need Debian, the first its binutils, and maven for other systems than Linux;
`windows_wheel` needs Debian's wine64 and maven, `publish` GitHub's gh.
"""

from __future__ import annotations

import platform
import shutil
from pathlib import Path

import nox
from manifest import read_version
from wheel_platforms import PLATFORMS, package_names, zip_name

BUILD_TOOLS = ("cmake>=3.25", "ninja>=1.11")
# Pinned: one compiler for the wheels of all Pythons, and the Blender whose tools make the zip of them.
PYBIND11 = "pybind11==3.1.0"
BUILD_BACKEND = (PYBIND11, "scikit-build-core==1.1.2")
WHEEL_TOOLS = (*BUILD_BACKEND, "ziglang==0.17.1", "zopflipy==1.14")
BLENDER = "bpy==5.0.1"
BUILD = "build==1.6.1"
TQDM = "tqdm==4.70.1"  # the command line's progress bar, in the zip
MARKDOWN = "markdown==3.11.3"  # makes the manual in the zip
TWINE = "twine==7.0.0"


@nox.session(default=False)
def extension(session: nox.Session) -> None:
    """Build the engine's wheels in dist/wheels, and of them a zip in dist/ for each platform of Blender 4.2 and later.

    All platforms and Pythons, or those after `--`: `-- linux-x64 windows-x64:3.11` makes two zips, the second for one
    Python only.
    """
    session.install(*BUILD_TOOLS, *WHEEL_TOOLS, MARKDOWN, BLENDER)
    for built in Path("dist").glob("perfect_bvh-*.zip"):
        built.unlink()
    shutil.rmtree("dist/wheels", ignore_errors=True)
    chosen = ("--platform", *session.posargs) if session.posargs else ()
    session.run("python", "release/build_wheels.py", "dist/wheels", *chosen)
    shutil.rmtree("build/wheels", ignore_errors=True)
    shutil.copytree("dist/wheels", "build/wheels")
    session.run("python", "-m", "pip", "download", "--quiet", "--no-deps", TQDM, "--dest", "build/wheels")
    session.run("python", "release/extension_folder.py", "build/extension", "build/wheels")
    scripts = str(
        session.run("python", "-c", "import bpy; print(bpy.utils.system_resource('SCRIPTS'))", silent=True)
    ).splitlines()[-1]
    tool = f"{scripts}/addons_core/bl_pkg/cli/blender_ext.py"
    folders = ("--source-dir", "build/extension", "--output-dir", "dist")
    session.run("python", tool, "build", "--split-platforms", *folders)
    for built in sorted(Path("dist").glob("perfect_bvh-*.zip")):
        session.run("python", tool, "validate", str(built))


@nox.session(default=False)
def listing_check(session: nox.Session) -> None:
    """Find faults in the zips in dist/ that reviewers of extension listings reject."""
    session.run("python", "release/listing_check.py", *map(str, sorted(Path("dist").glob("perfect_bvh-*.zip"))))


@nox.session(default=False)
def repository(session: nox.Session) -> None:
    """Make a repository of extensions from the zips in dist/, in build/extensions or `-- FOLDER`; Blender follows it.

    Blender's module has the tool for that; the engine is not installed.
    """
    session.install(BLENDER)
    folder = session.posargs[0] if session.posargs else "build/extensions"
    zips = sorted(Path("dist").glob("perfect_bvh-*.zip"))
    session.run("python", "release/repository.py", folder, *map(str, zips))


@nox.session(default=False)
def sdist(session: nox.Session) -> None:
    """Build source distributions: the engine's in dist/wheels, the whole project's, of all files in git, in dist/."""
    session.install(BUILD, *BUILD_BACKEND)
    session.run("python", "release/engine_sources.py", "build/engine-sources")
    make = ("python", "-m", "build", "--sdist", "--no-isolation", "--outdir")
    session.run(*make, "dist/wheels", "build/engine-sources")
    # From a separate folder: here the build would go through all caches and environments next to the sources.
    sources = Path("build/project-sources")
    shutil.rmtree(sources, ignore_errors=True)
    session.run("git", "checkout-index", "--all", f"--prefix={sources}/", external=True)
    session.run(*make, "dist", str(sources))


@nox.session(default=False)
def arm64_pythons(session: nox.Session) -> None:
    """Unpack Pythons for 64-bit ARM into .cache/arm64_pythons, for tests/extension to try the zip's wheels in."""
    session.run("python", "release/arm64_pythons.py")


@nox.session(default=False)
def windows_wheel(session: nox.Session) -> None:
    """Test the wheel and the zip for Windows under Wine, compared with Linux, which takes hours.

    `-- short` is the steps that need no Blender and at most four minutes; `-- images command_line` are two steps by
    name, which tests/wine/try_wheel.py lists. `nox -s extension -- windows-x64` builds the tested files.
    """
    wheels = sorted(Path("dist/wheels").glob("*-cp311-win_amd64.whl"))
    if not wheels:
        session.error("no wheel for Windows in dist/wheels: `nox -s extension -- windows-x64` builds it")
    session.install("numpy>=1.26" if session.posargs == ["short"] else ".[blender]")
    session.run("python", "tests/wine/try_wheel.py", str(wheels[-1]), *session.posargs)


@nox.session(default=False)
def wheel_tests(session: nox.Session) -> None:
    """Install the engine's wheel from dist/ that fits this system and Python, and run the Python tests on it.

    Nothing is compiled, so that this runs on any system: wheels that `extension` built elsewhere are tested on their
    target. Arguments after `--` go to pytest.
    """
    project = nox.project.load_toml("pyproject.toml")["project"]
    extras = project["optional-dependencies"]
    # Blender has no module for Linux on ARM: there, name the tests that do not need it.
    has_blender = (platform.system(), platform.machine()) != ("Linux", "aarch64")
    # The package itself is installed below, without being compiled: the requirements of its other extras are named
    # here.
    tools = [tool for tool in extras["test"] if not tool.startswith("perfect-bvh[")]
    is_without = (platform.system(), platform.machine()) == ("Windows", "ARM64")
    data = [] if is_without else [*extras["data"], *extras["ros"]]
    session.install(*project["dependencies"], *(extras["blender"] if has_blender else ()), *tools, *data)
    install_engine(session)
    copy_addon(session)
    session.run("pytest", *session.posargs)


def install_engine(session: nox.Session) -> None:
    """Install the wheel in dist/wheels that fits this system and Python; nothing is compiled."""
    found = ("--only-binary=:all:", "--no-deps", "--no-index", "--find-links", "dist/wheels")
    session.install(*found, "perfect-bvh-engine")


def copy_addon(session: nox.Session) -> None:
    """Put the add-on's sources into the session's environment, under the name that they have as a package."""
    asked = "import sysconfig; print(sysconfig.get_path('purelib'))"
    packages = Path(str(session.run("python", "-c", asked, silent=True)).strip())
    shutil.copytree("addon", packages / "perfect_bvh_addon", dirs_exist_ok=True)


@nox.session(default=False)
def publish(session: nox.Session) -> None:
    """Upload the files in dist/ as the release of a tag, `-- v1.2.3`: wheels for pip, zips for Blender.

    Needs GitHub's `gh` and rights to both; a workflow has them by its identity. Stops before the first upload if the
    tag is not the version, or if a zip, a wheel or the sources are missing.
    """
    if len(session.posargs) != 1:
        session.error("which tag? nox -s publish -- v1.2.3")
    (tag,) = session.posargs
    version = read_version()
    if tag != f"v{version}":
        session.error(f"the tag {tag} is not that of version {version} in addon/blender_manifest.toml")
    zips = [Path("dist") / zip_name(version, name) for name in PLATFORMS]
    packages = [Path("dist/wheels") / name for name in package_names(version)]
    missing = [path.as_posix() for path in (*zips, *packages) if not path.is_file()]
    if missing:
        session.error(f"missing; `nox -s extension sdist` makes them: {', '.join(missing)}")
    session.install(TWINE)
    session.run("twine", "check", "--strict", *map(str, packages))
    session.run("twine", "upload", "--skip-existing", *map(str, packages))
    session.run("gh", "release", "create", tag, "--verify-tag", "--generate-notes", *map(str, zips), external=True)


def extension_zip() -> Path:
    """The zip for Blender on this machine, where Linux's windows are tried."""
    return Path("dist") / zip_name(read_version(), "linux-arm64" if platform.machine() == "aarch64" else "linux-x64")
