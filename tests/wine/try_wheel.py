"""Tests the engine's wheel for Windows, the add-on and the extension's zip under Wine, compared with this Linux.

    python tests/wine/try_wheel.py ENGINE.whl [STEP ...]

Steps, all of them unless named; `short` is those of four minutes. Steps that need Linux's answers require the project
with Blender's module in this Python. Wine is Debian's package wine64; everything else is fetched into .cache/wine.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from command_line import compare_command_lines
from press_ctrl_c import check_interrupts
from system import BLENDER_PACKAGES, NUMPY, REPOSITORY, TEST_PACKAGES, WineSystem, windows_path

PYTEST = ("-m", "pytest", "-n", "0", "-q", "-p", "no:cacheprovider")
# Tests that a system could break: each kind of query, invalid input, the boundary of C++ and Python; in a minute.
SHORT_TESTS = ("test_hit_table", "test_bad_input", "test_bulk", "test_isas", "test_scene", "test_render_calls")
OUTPUT = REPOSITORY / "build" / "wine"


class Trial:
    """The steps, with their shared state. Each raises SystemExit on a fault."""

    def __init__(self, system: WineSystem, wheel: Path) -> None:
        self.system = system
        self.tests = system.install("tests", TEST_PACKAGES)
        self.engine = self._unpack(wheel, "engine")
        self.addon = OUTPUT / "addon"
        shutil.rmtree(self.addon, ignore_errors=True)
        self.addon.mkdir()
        (self.addon / "perfect_bvh_addon").symlink_to(REPOSITORY / "addon")

    def _unpack(self, archive: Path, name: str) -> Path:
        folder = OUTPUT / name
        shutil.rmtree(folder, ignore_errors=True)
        with zipfile.ZipFile(archive) as file:
            file.extractall(folder)
        return folder

    def run(self, *arguments: Path | str, seconds: float, blender: bool = False) -> str:
        """The output of a program for Windows' Python, which must have succeeded."""
        packages = [self.engine, self.addon, self.tests]
        if blender:
            packages.append(self.system.install("blender", BLENDER_PACKAGES))
        status, written = self.system.run(arguments, packages=packages, seconds=seconds)
        if status:
            raise SystemExit(f"Windows' Python ended with {status}: {' '.join(map(str, arguments))}")
        return written

    def run_here(self, *arguments: Path | str) -> None:
        """Runs a program on Linux."""
        subprocess.run([sys.executable, *arguments], check=True, cwd=REPOSITORY, timeout=600)

    def short(self) -> None:
        """The table of hits, and the tests nearest to a system."""
        self.run(REPOSITORY / "tests" / "hit_table" / "table.py", seconds=400)
        self.run(*PYTEST, *(f"tests/engine/{name}.py" for name in SHORT_TESTS), seconds=400)

    def engine_tests(self) -> None:
        """Every test that needs no Blender."""
        self.run(*PYTEST, "tests/engine", "tests/stress", "tests/sync", seconds=3600)

    def images(self) -> None:
        """One record of a scene, read on Linux, has the same pixels in every mode, bit for bit."""
        record, here, there = (OUTPUT / name for name in ("record.pickle", "linux.npz", "windows.npz"))
        scripts = REPOSITORY / "tests" / "wine"
        self.run_here(scripts / "read_blend.py", REPOSITORY / "blend_scenes" / "courtyard.blend", record)
        self.run_here(scripts / "trace_record.py", record, here)
        self.run(scripts / "trace_record.py", record, there, seconds=400)
        with np.load(here) as linux, np.load(there) as windows:
            differing = [mode for mode in linux if linux[mode].tobytes() != windows[mode].tobytes()]
            for mode in linux:
                print(f"{mode:12}{'DIFFERS' if mode in differing else 'same'}", flush=True)
        if differing:
            raise SystemExit(f"The engine's images differ between Linux and Windows: {', '.join(differing)}")

    def command_line(self) -> None:
        """`perfect-bvh render` of one file, each system with its own Blender."""
        compare_command_lines(self, REPOSITORY / "blend_scenes" / "courtyard.blend", OUTPUT)

    def ctrl_c(self) -> None:
        """Ctrl-C in a console ends every kind of wait."""
        check_interrupts(self.system, [self.engine, self.addon, self.tests], OUTPUT)

    def blender_tests(self) -> None:
        """Every test that needs Blender's module."""
        self.run(*PYTEST, "tests/blender", seconds=4 * 3600, blender=True)

    def extension(self) -> None:
        """The zip installed as a user does it, in a Blender that has nothing else of the project."""
        zips = sorted((REPOSITORY / "dist").glob("perfect_bvh-*windows_x64.zip"))
        if not zips:
            raise SystemExit("no zip for Windows in dist: `nox -s extension -- windows-x64` builds it")
        script = REPOSITORY / "tests" / "wine" / "install_extension.py"
        image, file = OUTPUT / "extension.png", REPOSITORY / "blend_scenes" / "courtyard.blend"
        image.unlink(missing_ok=True)
        blender = [self.system.install("blender", BLENDER_PACKAGES), self.system.install("numpy", NUMPY)]
        words = (script, *(windows_path(path) for path in (zips[-1], file, image)))
        status, _ = self.system.run(words, packages=blender, seconds=600)
        if status or not image.is_file():
            raise SystemExit("The extension's zip did not install or render")


STEPS: dict[str, Callable[[Trial], None]] = {
    "short": Trial.short,
    "engine": Trial.engine_tests,
    "images": Trial.images,
    "command_line": Trial.command_line,
    "ctrl_c": Trial.ctrl_c,
    "extension": Trial.extension,
    "blender": Trial.blender_tests,
}


def main(arguments: Sequence[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Try the engine's wheel for Windows under Wine.")
    parser.add_argument("wheel", type=Path, help="for CPython 3.11 and win_amd64")
    parser.add_argument("steps", nargs="*", metavar="STEP", help=f"of {', '.join(STEPS)}; all of them unless named")
    chosen = parser.parse_args(arguments)
    unknown = set(chosen.steps) - set(STEPS)
    if unknown:
        parser.error(f"no such step: {', '.join(sorted(unknown))}; there are {', '.join(STEPS)}")
    OUTPUT.mkdir(parents=True, exist_ok=True)
    with WineSystem() as system:
        trial = Trial(system, chosen.wheel.resolve())
        for name in chosen.steps or STEPS:
            started = time.monotonic()
            print(f"==== {name}: {STEPS[name].__doc__}", flush=True)
            STEPS[name](trial)
            print(f"==== {name}: {time.monotonic() - started:.0f} s", flush=True)


if __name__ == "__main__":
    main()
