"""Describes the machine that a benchmark ran on: figures mean nothing without it."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import perfect_bvh

REPOSITORY = Path(__file__).resolve().parent.parent.parent
MOST_LOAD = 1.2  # processes that run or want to, in the mean of a minute; kMostLoad in native/benchmarks/quiet.h


def require_quiet(is_noisy: bool) -> float:
    """The load; ends the program with a sentence where it makes figures worthless, unless is_noisy."""
    load = os.getloadavg()[0]
    if load > MOST_LOAD and not is_noisy:
        raise SystemExit(
            f"the load is {load:.2f}, above {MOST_LOAD}: wait until the machine is quiet, "
            "or measure all the same with --noisy"
        )
    return load


def describe(load_before: float | None = None) -> dict[str, Any]:
    """Machine, caches, instruction sets, versions, commit and load, as JSON takes them.

    load_before: the load of the minute before the run; load_average is then the load at the end.
    """
    return {
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": commit(),
        "processor": processor(),
        "caches": caches(),
        "threads": perfect_bvh.thread_count(),
        "system": platform.platform(),
        "load_before": load_before,
        "load_average": os.getloadavg(),
        "isa": perfect_bvh.active_isa(),
        "available_isas": list(perfect_bvh.available_isas()),
        "versions": {
            "perfect_bvh": perfect_bvh.__version__,
            "python": platform.python_version(),
            "numpy": np.__version__,
            "embreex": version_of("embreex"),
            "bpy": version_of("bpy"),
        },
        "command": [
            Path(word).name if Path(word).is_absolute() else word for word in (Path(sys.argv[0]).name, *sys.argv[1:])
        ],
    }


def processor() -> str:
    """The processor's name from Linux, or else from Python."""
    table = Path("/proc/cpuinfo")
    for line in table.read_text().splitlines() if table.is_file() else ():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def caches() -> dict[str, str]:
    """Sizes by level, of data, as Linux has them: {"L1d": "32K", "L2": "1024K", "L3": "32768K"}; else nothing."""
    found = {}
    for folder in sorted(Path("/sys/devices/system/cpu/cpu0/cache").glob("index*")):
        files = (folder / name for name in ("level", "type", "size"))
        level, kind, size = (file.read_text().strip() if file.is_file() else "" for file in files)
        if size and kind != "Instruction":
            found[f"L{level}{'d' if kind == 'Data' else ''}"] = size
    return found


def headline(machine: dict[str, Any]) -> str:
    """The heading of a table, from the result of `describe`."""
    sizes = "".join(f", {level} {size}" for level, size in machine["caches"].items())
    loads = f"load {machine['load_before']:.2f} before, " if machine["load_before"] is not None else "load "
    return f"{machine['processor']}{sizes}; {loads}{machine['load_average'][0]:.2f} after; {machine['commit']}"


def gigahertz() -> float | None:
    """The processors' clock in the mean, as Linux has it now; None where it does not say."""
    table = Path("/proc/cpuinfo")
    lines = table.read_text().splitlines() if table.is_file() else ()
    clocks = [float(line.partition(":")[2]) for line in lines if line.startswith("cpu MHz")]
    return 1e-3 * sum(clocks) / len(clocks) if clocks else None


def commit() -> str | None:
    """The checkout's commit, with a plus sign if files differ from it; None outside a checkout."""
    try:
        name = _git("rev-parse", "--short=12", "HEAD")
        changed = _git("status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.CalledProcessError):
        return None
    return name + ("+" if changed else "")


def _git(*arguments: str) -> str:
    command = ["git", "-C", str(REPOSITORY), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def version_of(package: str) -> str | None:
    """The installed version, None if it is not there."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None
