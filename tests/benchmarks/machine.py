"""What a benchmark ran on: figures mean nothing without it."""

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


def describe() -> dict[str, Any]:
    """Machine, instruction sets, versions, commit and load, as JSON takes them."""
    return {
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": commit(),
        "processor": processor(),
        "threads": perfect_bvh.thread_count(),
        "system": platform.platform(),
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
    """The processor's name as Linux has it, or what Python knows."""
    table = Path("/proc/cpuinfo")
    for line in table.read_text().splitlines() if table.is_file() else ():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


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
