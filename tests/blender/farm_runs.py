"""Shared helpers for tests of workers: a small scene with a sensor, `perfect-bvh` as a process, and its output."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from blender.sensor_flight import SENSOR, save_flight

RUN_MAIN = "import sys; sys.argv[0] = 'perfect-bvh'; from perfect_bvh_addon.cli import main; sys.exit(main())"
BEAM = """[beam]
divergence = 5
rays = 3
returns = 2
resolution = 0.1
[noise]
range = 0.01
angle = 0.5
dropout = 0.1
"""
TIMEOUT = 600

# A command, and its options, for six chunks.
JOBS = {
    "scan": ("scan", "--sensor", "sensor.toml", "--on", "Head", "--steps", "2", "--seed", "5"),
    "labels": ("labels", "--size", "64x36"),
    "render": ("render", "--mode", "instance", "--samples", "2"),
    "bake": ("bake", "--kind", "ambient-occlusion", "--distance", "2", "--rays", "8"),
}


def save_scene(folder: Path) -> Path:
    """Save a file with a moving cube, a bending sheet and an empty that flies past, and a sensor file next to it."""
    return save_flight(folder, SENSOR + BEAM, last_frame=13)


def command(name: str, out: Path, *more: object, frames: str = "1-12") -> list[str]:
    """Build the command line of a job, to be run in the scene's folder."""
    verb, *options = JOBS[name]
    asked = ("small.blend", "-o", f"{out}/", "--frames", frames, "--chunk", 2, "-q")
    return [sys.executable, "-c", RUN_MAIN, verb, *map(str, (*asked, *options, *more))]


def run_job(folder: Path, name: str, out: Path, *more: object, frames: str = "1-12") -> tuple[int, str]:
    """Run a job; return its exit status and its standard error."""
    done = subprocess.run(
        command(name, out, *more, frames=frames), cwd=folder, capture_output=True, text=True, timeout=TIMEOUT
    )
    return done.returncode, done.stderr
