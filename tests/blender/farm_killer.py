"""Kills processes of runs with workers, at any time, until enough have died.

A run that ends, or whose own process was killed, is started again with --resume until it is complete. Its folder must
then be equal, byte by byte, to that of an undisturbed run without workers:

    PYTHONPATH=tests python tests/blender/farm_killer.py --kills 100 --seed 1
"""

from __future__ import annotations

import argparse
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil
from blender.farm_runs import JOBS, RUN_MAIN, command, run_job, save_scene
from blender.sensor_flight import contents

EXIT_FAILED_PIECES, EXIT_ERROR = 3, 2
KINDS = (*["Blender"] * 6, *["worker"] * 4, "tracker", "run")  # each kind is drawn in proportion to its entries
OWN_TRACE = re.compile(r'File ".*(addon|distributed)')  # Python's own tracker of resources complains if it is killed


class Killer:
    """Kills at random, with a seed. rate: mean number of attempts a second, each at a random kind of process."""

    def __init__(self, seed: int, rate: float) -> None:
        self._random = random.Random(seed)
        self._rate = rate
        self.killed: list[str] = []

    def attend(self, process: subprocess.Popen[str], most: int) -> None:
        """Kill until the process has ended, or `most` processes have died in all."""
        while process.poll() is None:
            deadline = time.monotonic() + self._random.expovariate(self._rate)
            while process.poll() is None and time.monotonic() < deadline:
                time.sleep(0.01)
            if process.poll() is None and len(self.killed) < most:
                self._kill_one(process.pid, self._random.choice(KINDS), self._random.random())

    def _kill_one(self, pid: int, kind: str, which: float) -> None:
        try:
            root = psutil.Process(pid)
            found = [root] if kind == "run" else root.children(recursive=True)
            found = sorted(
                (each for each in found if kind_of(" ".join(each.cmdline())) == kind), key=lambda each: each.pid
            )
            if found:
                found[int(which * len(found))].send_signal(signal.SIGKILL)
                self.killed.append(kind)
        except psutil.NoSuchProcess:
            return


def kind_of(words: str) -> str:
    """Return the kind of a process, by its command line."""
    parts = {"piece_child": "Blender", "spawn_main": "worker", "resource_tracker": "tracker", RUN_MAIN: "run"}
    return next((kind for part, kind in parts.items() if part in words), "other")  # such as compilers


def complete(
    folder: Path, name: str, out: Path, killer: Killer, most: int, workers: int = 2, frames: str = "1-12"
) -> int:
    """Run a job until it is complete, killing processes of it; return the number of runs."""
    for count in range(1, 1000):
        more = ("--workers", workers, *(("--resume",) if count > 1 else ()))
        with subprocess.Popen(
            command(name, out, *more, frames=frames),
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        ) as process:
            killer.attend(process, most)
            errors = process.stderr.read()
        if process.returncode == 0:
            return count
        if process.returncode not in (-signal.SIGKILL, EXIT_FAILED_PIECES, EXIT_ERROR) or OWN_TRACE.search(errors):
            raise AssertionError(f"the run ended with {process.returncode}: {errors}")
    raise AssertionError(f"{name}: a thousand runs were not enough")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--frames", default="1-200", help="of each job")
    parser.add_argument("--each", type=int, default=8, help="most kills until a job is left to complete itself")
    parser.add_argument("--rate", type=float, default=1.0, help="attempts a second")
    asked = parser.parse_args()
    killer, rounds = Killer(asked.seed, asked.rate), 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        save_scene(folder)
        expected = {}
        for job in JOBS:
            status, errors = run_job(folder, job, folder / f"{job}_whole", "--resume", frames=asked.frames)
            assert status == 0, errors
            expected[job] = contents(folder / f"{job}_whole")
        while len(killer.killed) < asked.kills:
            job = list(JOBS)[rounds % len(JOBS)]
            out = folder / f"out_{rounds}"
            most = min(asked.kills, len(killer.killed) + asked.each)
            runs = complete(folder, job, out, killer, most, workers=1 + rounds % 3, frames=asked.frames)
            rounds += 1
            is_same = contents(out) == expected[job]
            counts = {kind: killer.killed.count(kind) for kind in sorted(set(killer.killed))}
            sys.stderr.write(f"{job}: {runs} runs, same bytes: {is_same}; killed so far: {counts}\n")
            if not is_same:
                return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
