"""Fingerprints of all that the project answers, to prove that a change of its inside changed no answer.

    python tests/fingerprints/record.py before.json
    python tests/fingerprints/record.py after.json
    python tests/fingerprints/record.py --compare before.json after.json

The first two are run with the package of before and of after the change; each takes about a minute of one core and
writes a sha256 for each named item: every query on eleven generated scenes, and for each file in
blend_scenes its sync reports, images, lookups, scans and renders through Blender and the command line. The engine's
items are made with every instruction set that the machine has, and must agree. Only what users' scripts can reach is
called, so that one program fits both packages. Items with `/visits/` in their names count nodes and triangles that rays
visited: a change of a tree may change them, and nothing else. `--compare` names the items that
differ and exits with 1 if any does.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

TESTS = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(TESTS))

import numpy as np
import numpy.typing as npt
import perfect_bvh
from fingerprints.digests import Items, Recorder

SCENES = TESTS.parent / "blend_scenes"


def main(arguments: Sequence[str] | None = None) -> int:
    """The exit status."""
    parser = argparse.ArgumentParser(description="Record fingerprints of all answers, or compare two records.")
    parser.add_argument("out", type=Path, nargs="?", metavar="OUT.json", help="where to write the record")
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("OLD.json", "NEW.json"), help="name what differs")
    parser.add_argument("--part", metavar="NAME", help="this part alone, in this process: engine, or a .blend file")
    chosen = parser.parse_args(arguments)
    if chosen.compare:
        old, new = (json.loads(path.read_text(encoding="utf-8")) for path in chosen.compare)
        differing = differences(old, new)
        print("\n".join([*differing, f"{len(differing)} of {len(old.keys() | new.keys())} items differ"]))
        return 1 if differing else 0
    if chosen.out is None:
        parser.error("OUT.json is missing")
    items = record_part(chosen.part) if chosen.part else record_all()
    chosen.out.write_text(json.dumps(items, indent=0, sort_keys=True) + "\n", encoding="utf-8")
    print(f"{len(items)} items in {chosen.out}")
    return 0


def differences(old: Items, new: Items) -> list[str]:
    """Sentences, one for each item that is not the same in both records."""
    missing = [f"gone: {name}" for name in sorted(old.keys() - new.keys())]
    added = [f"new: {name}" for name in sorted(new.keys() - old.keys())]
    return [
        *missing,
        *added,
        *(f"changed: {name}" for name in sorted(old.keys() & new.keys()) if old[name] != new[name]),
    ]


def record_part(name: str) -> Items:
    """The engine's items, with the instruction set of this process, or those of one .blend file."""
    recorder = Recorder()
    if name == "engine":
        from fingerprints.engine_answers import record_engine

        record_engine(recorder.within("engine"))
        return recorder.items
    from fingerprints.blend_answers import record_blend

    with tempfile.TemporaryDirectory() as folder:
        record_blend(recorder.within(Path(name).stem), Path(name), Path(folder))
        return recorder.items


def record_all() -> Items:
    """Each part in a process of its own."""
    items: Items = {}
    with tempfile.TemporaryDirectory() as folder:
        for isa in perfect_bvh.available_isas():
            found = _run_part("engine", Path(folder), isa)
            differing = differences(items, found) if items else []
            if differing:
                raise AssertionError(f"{isa} and the instruction sets before it disagree: {', '.join(differing[:20])}")
            items |= found
        for path in sorted(SCENES.glob("*.blend")):
            items |= _run_part(str(path), Path(folder))
            recorder = Recorder(items, f"{path.stem}/command_line/")
            recorder.add_all(_run_command_line(path, Path(folder) / path.stem))
    return items


def _environment(isa: str | None = None) -> dict[str, str]:
    """The package's own calibration, whatever was measured on this machine: decisions follow it."""
    calibration = Path(perfect_bvh.__file__).parent / "calibration.json"
    environment = os.environ | {"PERFECT_BVH_CALIBRATION": str(calibration)}
    return environment if isa is None else environment | {"PERFECT_BVH_ISA": isa}


def _run_part(name: str, folder: Path, isa: str | None = None) -> Items:
    out = folder / "part.json"
    command = [sys.executable, __file__, str(out), "--part", name]
    subprocess.run(command, check=True, env=_environment(isa), stdout=subprocess.DEVNULL)
    items: Items = json.loads(out.read_text(encoding="utf-8"))
    return items


def _run_command_line(path: Path, folder: Path) -> dict[str, npt.NDArray[np.uint8]]:
    """The images that `perfect-bvh render` writes, by file name, as bytes."""
    program = "import sys; from perfect_bvh_addon.cli import main; sys.exit(main())"
    options = ["--frames", "1-3", "--size", "96x54", "--samples", "2", "--quiet"]
    command = [sys.executable, "-c", program, "render", str(path), "-o", f"{folder}/", *options]
    subprocess.run(command, check=True, env=_environment(), stdout=subprocess.DEVNULL)
    return {image.name: np.frombuffer(image.read_bytes(), np.uint8) for image in sorted(folder.iterdir())}


if __name__ == "__main__":
    sys.exit(main())
