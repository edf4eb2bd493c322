"""The long run of random edits, with a given number of steps in several processes; it can be stopped and resumed.

    python tests/blender/soak_run.py --steps 20000 --processes 2 --json tests/benchmarks/results/soak.json

Each seed is a separate scene, and its steps are the same on every machine and in every run. Each finished seed is
written to OUT.json.seeds at once, one line for each. A later call runs only the missing seeds, unless the commit has
changed. A process that dies counts as a difference of its current seed.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Lock
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.machine import describe
from benchmarks.rows import write_rows

STEPS_A_SEED = 250
SEEDS_A_PROCESS = 8  # leftovers of a process must not pile up: its memory is reported after each seed


# One process ---------------------------------------------------------------------------------------------------------


def run_seed(seed: int, steps: int) -> dict[str, Any]:
    """Take the steps of one seed, up to the first difference. Handlers are on for every other seed."""
    from blender.soak import KINDS, DifferenceError, Soak

    started = time.perf_counter()
    soak = Soak(seed, watches=seed % 2 == 0, kind=KINDS[seed // 2 % 3], halves=1.0)
    differences: list[str] = []
    done = 0
    try:
        while done < steps and not differences:
            done += 1
            try:
                soak.step()
            except DifferenceError as difference:
                differences.append(str(difference))
    finally:
        soak.close()
    return {
        "seed": seed,
        "steps": done,
        "differences": differences,
        "counts": dict(soak.counts),
        "seconds": round(time.perf_counter() - started, 1),
        "resident_megabytes": _resident_megabytes(),
    }


def _resident_megabytes() -> float | None:
    """Return the resident memory of this process; None where the system does not report it as Linux does."""
    table = Path("/proc/self/status")
    if not table.is_file():
        return None
    (kilobytes,) = (line.split()[1] for line in table.read_text().splitlines() if line.startswith("VmRSS"))
    return round(int(kilobytes) / 1024, 1)


def work(seeds: Iterable[int], steps: int) -> None:
    """Announce each seed and then write its result, one line each."""
    for number, seed in enumerate(seeds):
        _tell({"begins": seed})
        _tell({**run_seed(seed, steps), "seed_of_the_process": number})


def _tell(message: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(message) + "\n")
    sys.stdout.flush()


# All of them ---------------------------------------------------------------------------------------------------------


class Run:
    """Distributes seeds among processes and keeps their reports."""

    def __init__(self, seeds: list[int], steps: int, path: Path, until: float) -> None:
        self._steps = steps
        self._until = until
        self._path = path
        self._lock = Lock()
        self._commit = describe()["commit"]
        self.results = _kept(path, self._commit, set(seeds))
        self._waiting = [seed for seed in seeds if seed not in self.results]
        self._total = len(seeds)

    def go(self, processes: int) -> None:
        with ThreadPoolExecutor(processes) as threads:
            for finished in [threads.submit(self._drive) for _ in range(processes)]:
                finished.result()

    def _drive(self) -> None:
        while seeds := self._take(SEEDS_A_PROCESS):
            self._run_process(seeds)

    def _take(self, count: int) -> list[int]:
        with self._lock:
            if time.monotonic() > self._until:
                return []
            taken, self._waiting = self._waiting[:count], self._waiting[count:]
            return taken

    def _run_process(self, seeds: list[int]) -> None:
        arguments = [sys.executable, __file__, "--work", *map(str, seeds), "--steps", str(self._steps)]
        started = -1
        with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            assert process.stderr is not None
            with ThreadPoolExecutor(1) as reader:
                complaints = reader.submit(process.stderr.read)
                for line in process.stdout:
                    if not line.startswith('{"'):
                        continue  # Blender's own output
                    message = json.loads(line)
                    if "begins" in message:
                        started = message["begins"]
                    else:
                        self._keep(message)
                        seeds.remove(message["seed"])
            if process.wait():
                why = "\n".join(complaints.result().strip().splitlines()[-5:])
                if started not in seeds:
                    raise RuntimeError(f"a process ended with {process.returncode} before it began: {why}")
                differences = [f"seed {started}: its process ended with {process.returncode}: {why}"]
                self._keep({"seed": started, "steps": 0, "differences": differences, "counts": {}, "seconds": 0.0})
                seeds.remove(started)
        with self._lock:
            self._waiting = seeds + self._waiting

    def _keep(self, result: dict[str, Any]) -> None:
        with self._lock:
            self.results[result["seed"]] = result
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"commit": self._commit, **result}) + "\n")
            steps = sum(one["steps"] for one in self.results.values())
            found = sum(len(one["differences"]) for one in self.results.values())
            sys.stdout.write(
                f"{len(self.results)} of {self._total} seeds, {steps} steps, {found} differences; "
                f"seed {result['seed']} took {result['seconds']} s\n"
            )
            sys.stdout.flush()


def _kept(path: Path, commit: str | None, seeds: set[int]) -> dict[int, dict[str, Any]]:
    """Read the results of an earlier run of the same commit."""
    if not path.is_file():
        return {}
    rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return {row["seed"]: row for row in rows if row["commit"] == commit and row["seed"] in seeds}


def summarise(results: dict[int, dict[str, Any]], wanted: int, wall_seconds: float) -> dict[str, Any]:
    """Summarise the results: sums over the seeds, every difference, and the memory of the processes."""
    from blender.soak_halves import HALVES  # at the end, because it imports Blender

    counts: Counter[str] = Counter()
    for result in results.values():
        counts.update(result["counts"])
    memory: dict[int, list[float]] = {}
    for result in results.values():
        if result.get("resident_megabytes"):
            memory.setdefault(result["seed_of_the_process"], []).append(result["resident_megabytes"])
    seconds = sum(result["seconds"] for result in results.values())
    steps = sum(result["steps"] for result in results.values())
    special = (
        "meshes",
        "meshes passed over",
        "read again",
        "instances read from geometry",
        "objects looked up in the list",
    )
    return {
        "machine": describe(),
        "steps": steps,
        "steps_wanted": wanted,
        "steps_a_seed": STEPS_A_SEED,
        "seeds": sorted(results),
        "differences": [line for seed in sorted(results) for line in results[seed]["differences"]],
        "edits": {name: counts[name] for name in sorted(counts) if name not in special and not name.startswith(HALVES)},
        "updates_in_halves": {name.removeprefix(HALVES): counts[name] for name in sorted(counts) if HALVES in name},
        "meshes_compared": counts["meshes"],
        "meshes_passed_over": counts["meshes passed over"],
        "read_again": counts["read again"],
        "instances_read_from_geometry": counts["instances read from geometry"],
        "objects_looked_up_in_the_list": counts["objects looked up in the list"],
        # The median and the maximum over the processes, after their first seed, their second, and so on.
        "resident_megabytes": [[statistics.median(memory[nth]), max(memory[nth])] for nth in sorted(memory)],
        "seconds_of_all_processes": round(seconds, 1),
        "steps_a_second_and_process": round(steps / seconds, 2) if seconds else None,
        "wall_seconds_of_the_last_call": round(wall_seconds, 1),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=20_000, help="of all seeds together, 250 each")
    parser.add_argument("--first-seed", type=int, default=0, metavar="SEED")
    parser.add_argument("--processes", type=int, default=2, metavar="N")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no more seeds after so long")
    parser.add_argument("--json", type=Path, default=Path("soak.json"), metavar="OUT.json")
    parser.add_argument("--work", type=int, nargs="+", metavar="SEED", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        work(options.work, options.steps)
        return 0
    started = time.monotonic()
    seeds = list(range(options.first_seed, options.first_seed + -(-options.steps // STEPS_A_SEED)))
    options.json.parent.mkdir(parents=True, exist_ok=True)
    lines = options.json.with_name(options.json.name + ".seeds")
    run = Run(seeds, min(STEPS_A_SEED, options.steps), lines, started + 60 * options.minutes)
    try:
        run.go(options.processes)
    finally:  # write the results even after an interruption
        result = summarise(run.results, options.steps, time.monotonic() - started)
        write_rows(options.json, result)
    sys.stdout.write(f"{options.json}: {result['steps']} steps, {len(result['differences'])} differences\n")
    return 1 if result["differences"] or result["steps"] < options.steps else 0


if __name__ == "__main__":
    sys.exit(main())
