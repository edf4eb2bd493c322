"""Measures the charts' figures and writes them to data/: python tests/charts/measure.py [NAME ...] [--mesh FILE ...].

Everything takes about ten minutes on two quiet cores. Charts of single meshes show the meshes that --mesh names
together with those that Blender makes; the native programs are searched for in --native.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(REPOSITORY / "tests"))

from benchmarks.machine import MOST_LOAD, require_quiet
from benchmarks.rows import write_rows
from charts.drawn import drawn
from charts.figures import DATA, Figures, load

BENCHMARKS = Path("tests") / "benchmarks"
SCENES = ("blend_scenes/courtyard.blend",)  # that are measured as one mesh

# NAME.json: the benchmark and its arguments. Those in the second table measure meshes.
WHOLE: dict[str, str] = {
    "zoo": "../stress/zoo.py",
    "image_error": "image_error.py --size 480 --most 32 --seeds 1 --converged 1024",
    "stability": "stability.py",
    "policies": "sync.py --policies --rounds 3 --frames 24",
    "accuracy": "accuracy.py --rounds 3 --size 160x120 --ray-limit 5000",
}
OF_MESHES: dict[str, str] = {
    "builders": "build.py --default-meshes --trees auto median sweep binned spatial fast --threads 1 --rounds 3 "
    "--size 320x200 --ray-limit 5000 --seconds 6",
}
# Parts of the figures of `accuracy`, to be measured alone, as another run of it would.
PARTS: dict[str, str] = {"exact": "exact_edges.py --ray-limit 5000"}
NATIVE = (*OF_MESHES, "accuracy")  # which run native programs, and refuse to on a busy machine


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = [*OF_MESHES, *WHOLE]
    choice = f"of {', '.join(names)} or, for a part, {', '.join(PARTS)}; without any: all"
    parser.add_argument("names", nargs="*", metavar="NAME", help=choice)
    parser.add_argument(
        "--mesh", nargs="+", default=[], metavar="FILE", help="further meshes to measure: .npz, .ply, .obj, .blend"
    )
    parser.add_argument("--native", default="build/benchmarks", metavar="DIR", help="holds the built native benchmarks")
    parser.add_argument("--noisy", action="store_true", help=f"measure even where the load is above {MOST_LOAD}")
    chosen = parser.parse_args()
    require_quiet(chosen.noisy)
    for name in chosen.names:
        if name not in names and name not in PARTS:
            parser.error(f"nothing is called {name}; there are {', '.join(names)}")
    failed = []
    for name in chosen.names or names:
        started = time.perf_counter()
        if not measure(name, chosen):
            failed.append(name)
        print(f"{name}: {time.perf_counter() - started:.0f} s", flush=True)
    if failed:
        raise SystemExit(f"not measured, and left as they were: {', '.join(failed)}")


def measure(name: str, chosen: argparse.Namespace) -> bool:
    """Runs one benchmark and keeps its figures; False if it failed, after it has said why."""
    script, *words = (OF_MESHES | WHOLE | PARTS)[name].split()
    if name in NATIVE:
        # The load was asked for when this program began: its own is no reason to refuse.
        words += ["--noisy", "--native", chosen.native]
    if name in OF_MESHES:
        words += ["--mesh", *SCENES, *chosen.mesh]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / f"{name}.json"
        command = [sys.executable, str(BENCHMARKS / script), *words, "--json", str(out)]
        done = subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.DEVNULL, check=False)
        if done.returncode == 0:
            figures = json.loads(out.read_text(encoding="utf-8"))
            keep(*(("accuracy", load("accuracy") | {name: figures}) if name in PARTS else (name, figures)))
    return done.returncode == 0


def keep(name: str, figures: Figures) -> None:
    """Writes the figures that charts show to data/NAME.json, without the date, which is no measurement."""
    figures["machine"].pop("time", None)
    write_rows(DATA / f"{name}.json", drawn(name, rounded(figures)))


def rounded(value: Any) -> Any:
    """Five digits are more than any of this is exact to."""
    if isinstance(value, float):
        return float(f"{value:.5g}")
    if isinstance(value, dict):
        return {key: rounded(each) for key, each in value.items()}
    return [rounded(each) for each in value] if isinstance(value, list) else value


if __name__ == "__main__":
    main()
