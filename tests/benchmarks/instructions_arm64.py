"""Counts of instructions a ray on 64-bit ARM, by kernel: of its emulator, as times of an emulated process mean nothing.

    python tests/benchmarks/instructions_arm64.py build/arm64/src/libperfect_bvh_engine.a --zig ZIG [--json OUT.json]

The library is the one that `nox -s arm64` builds. The kernels are compiled again, as those of the wheels are: ZIG is
the compiler in the package ziglang; without it they are the library's own. Needs Debian's g++-aarch64-linux-gnu, gcc
and qemu-user (the emulator that takes plugins, which that of qemu-user-static does not). Nothing but the casting of
rays is counted, and the counts of two runs are the same.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from rows import write_rows

NATIVE = Path(__file__).resolve().parents[2] / "native"
PROGRAM = NATIVE / "benchmarks" / "instructions"
KERNELS = ("scalar", "neon")
# As native/CMakeLists.txt and native/cmake have them for a wheel.
WHEEL_TARGET = ("-target", "aarch64-linux-gnu.2.28")
WHEEL_OPTIONS = ("-O3", "-DNDEBUG", "-fPIC", "-ffp-contract=off", "-fno-exceptions")
Counts = dict[tuple[str, ...], dict[str, float]]


def build(library: Path, zig: Path | None, folder: Path) -> None:
    """The plugin, and the program for 64-bit ARM, into `folder`."""
    subprocess.run(["gcc", "-O2", "-fPIC", "-shared", PROGRAM / "counter.c", "-o", folder / "counter.so"], check=True)
    standard = ("-std=c++20", f"-I{NATIVE / 'src'}")
    kernels = []
    for kernel in KERNELS if zig is not None else ():
        kernels.append(folder / f"kernel_{kernel}.o")
        source = NATIVE / "src" / "traverse" / f"kernel_{kernel}.cpp"
        options = (*WHEEL_TARGET, *WHEEL_OPTIONS, *standard)
        subprocess.run([str(zig), "c++", *options, "-c", source, "-o", kernels[-1]], check=True)
    program = (PROGRAM / "cast_rays.cpp", *kernels, library, "-o", folder / "cast_rays")
    # The first kernels found are taken: the library has its own.
    options = ("-O1", "-static", "-Wl,--allow-multiple-definition")
    subprocess.run(["aarch64-linux-gnu-g++", *standard, *options, *program], check=True)


def count(folder: Path) -> Counts:
    """Instructions a ray, by scene, kind of rays, query and strategy; then by kernel."""
    command = ["qemu-aarch64", "-plugin", folder / "counter.so", folder / "cast_rays"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{PROGRAM / 'cast_rays.cpp'} failed: {done.stderr[-500:]}")
    counts: Counts = {}
    lines = [line.split() for line in done.stderr.splitlines()]
    (rays,) = (int(words[1]) for words in lines if words[0] == "rays")
    for i, words in enumerate(lines):
        if words[0] == "cast":
            before, after = (int(lines[i + k][1]) for k in (1, 2))
            counts.setdefault(tuple(words[1:5]), {})[words[5]] = (after - before) / rays
    return counts


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Count the instructions that a ray takes on 64-bit ARM.")
    parser.add_argument("library", type=Path, help="libperfect_bvh_engine.a for 64-bit ARM")
    parser.add_argument("--zig", type=Path, help="compile the kernels with it, as for wheels")
    parser.add_argument("--json", type=Path, help="write the counts there as well")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        build(arguments.library, arguments.zig, folder)
        counts = count(folder)
    print("scene      rays       query    strategy  scalar   neon  ratio")
    for (scene, kind, query, strategy), of in counts.items():
        ratio = of["neon"] / of["scalar"]
        print(f"{scene:10} {kind:10} {query:8} {strategy:8} {of['scalar']:7.0f} {of['neon']:6.0f} {ratio:6.3f}")
    if arguments.json:
        rows = {" ".join(key): {isa: round(value, 1) for isa, value in of.items()} for key, of in counts.items()}
        write_rows(arguments.json, rows)


if __name__ == "__main__":
    main()
