"""Compares the engine for Windows under Wine with that for Linux, on one machine, by turns.

    python tests/benchmarks/windows.py WINDOWS.whl LINUX.whl RECORD --rounds 5 --json windows.json

Both wheels are for CPython 3.11 and made by one compiler, so that only the system differs: its memory, threads and
clocks. RECORD is the file that `tests/wine/read_blend.py` has written for a scene. Each round runs both, the order
changing; of each figure the medians and quartiles are kept, and the ratio of each round's Wine to its Linux. The
machine's load is recorded too: on a busy machine the ratio of two runs is less reliable.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(REPOSITORY / "tests"), str(REPOSITORY / "tests" / "wine")]

import numpy as np
from machine import describe
from rows import write_rows
from system import TEST_PACKAGES, WineSystem

SCRIPT = REPOSITORY / "tests" / "wine" / "time_engine.py"
SECONDS = 600


def unpack(wheel: Path, folder: Path) -> Path:
    """The folder to import the engine from, in addition to the add-on's sources."""
    with zipfile.ZipFile(wheel) as file:
        file.extractall(folder)
    addon = folder / "perfect_bvh_addon"
    if not addon.is_symlink():
        addon.symlink_to(REPOSITORY / "addon")
    return folder


def spread(values: list[float]) -> dict[str, float]:
    """Median and quartiles."""
    low, median, high = np.quantile(values, (0.25, 0.5, 0.75))
    return {"median": round(float(median), 4), "low": round(float(low), 4), "high": round(float(high), 4)}


def compared(figure: str, rounds: list[dict[str, dict[str, float]]]) -> dict[str, dict[str, float]]:
    """Both systems' seconds, and the ratios of each round."""
    row = {name: spread([each[name][figure] for each in rounds]) for name in ("linux", "windows")}
    return row | {"ratio": spread([each["windows"][figure] / each["linux"][figure] for each in rounds])}


class Engines:
    """Both wheels unpacked below a folder, to be timed by one record of a scene."""

    def __init__(self, system: WineSystem, wheels: dict[str, Path], record: Path, folder: Path) -> None:
        self.system, self.record, self.folder = system, record, folder
        self.unpacked = {name: unpack(wheel, folder / name) for name, wheel in wheels.items()}
        self.tests = system.install("tests", TEST_PACKAGES)

    def measure(self, name: str) -> dict[str, float]:
        """Seconds by figure, on "linux" or on "windows"."""
        output = self.folder / f"{name}.json"
        arguments = [SCRIPT, self.record, output]
        if name == "windows":
            packages = [self.unpacked[name], self.tests]
            status, _ = self.system.run(arguments, packages=packages, seconds=SECONDS)
            if status != 0:
                raise SystemExit(f"{SCRIPT.name} under Wine ended with status {status}")
        else:
            environment = os.environ | {"PYTHONPATH": str(self.unpacked[name])}
            command = [sys.executable, *arguments]
            # A separate session, like Wine's: Linux shares processors out among sessions.
            subprocess.run(command, check=True, env=environment, timeout=SECONDS, start_new_session=True)
        figures: dict[str, float] = json.loads(output.read_text(encoding="utf-8"))
        return figures


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Time the engine under Wine and on Linux, by turns.")
    parser.add_argument("windows", type=Path, metavar="WINDOWS.whl")
    parser.add_argument("linux", type=Path, metavar="LINUX.whl")
    parser.add_argument("record", type=Path, metavar="RECORD")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--json", type=Path, metavar="OUT.json")
    chosen = parser.parse_args()
    wheels = {name: getattr(chosen, name).resolve() for name in ("linux", "windows")}
    rounds: list[dict[str, dict[str, float]]] = []
    loads = []
    with WineSystem() as system:
        engines = Engines(system, wheels, chosen.record.resolve(), REPOSITORY / "build" / "wine" / "speed")
        for number in range(chosen.rounds):
            order = ("linux", "windows") if number % 2 == 0 else ("windows", "linux")
            rounds.append({name: engines.measure(name) for name in order})
            loads.append(round(os.getloadavg()[0], 2))
    rows = {figure: compared(figure, rounds) for figure in rounds[0]["linux"]}
    for figure, row in rows.items():
        linux, windows, ratio = row["linux"], row["windows"], row["ratio"]
        words = f"{ratio['median']:6.2f} ({ratio['low']:.2f} to {ratio['high']:.2f})"
        print(f"{figure:20}{linux['median']:9.3f} s{windows['median']:9.3f} s{words}")
    if chosen.json:
        written = {"machine": describe(), "rounds": chosen.rounds, "load_averages": loads, "seconds": rows}
        write_rows(chosen.json, written)


if __name__ == "__main__":
    main()
