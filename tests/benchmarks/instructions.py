"""Counts of the engine's instructions, stage by stage: a speed that no other process on the machine disturbs.

    python tests/benchmarks/instructions.py MESH.npz ... --json counts.json

Each mesh file holds `positions` (V, 3) and `triangles` (T, 3). The stages of a mesh: its tree built, 20,000 rays of a
camera, 20,000 from where these hit into all directions, an image. Each runs in a separate process under `valgrind
--tool=callgrind`, on one thread. Only the work from just before a stage's call to its end is counted: the count of a
process that stops before the call is subtracted. Counts repeat within a few hundredths of a per cent, because Python's
own work differs. Valgrind does not support AVX-512, so the instruction set is avx2, or the one in PERFECT_BVH_ISA.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import perfect_bvh
from rows import write_rows

RAYS = (200, 100)
IMAGE_SIZE = (64, 36)
STAGES = ("prepare", "commit", "primary", "diffuse", "preview")


def run_stages(path: Path, last: str) -> None:
    """The stages of a mesh up to `last`, that one included."""
    perfect_bvh.set_thread_count(1)
    with np.load(path) as file:
        positions, triangles = file["positions"].astype(np.float32), file["triangles"].astype(np.int32)
    state: dict[str, Any] = {"camera": _camera(positions), "scene": perfect_bvh.Scene()}
    state["scene"].add_instance(state["scene"].add_mesh(positions, triangles))
    state["rays"] = _primary_rays(state["camera"])
    # Made before, so that no stage is charged with it.
    state["directions"] = np.random.default_rng(5).normal(size=state["rays"].shape).astype(np.float32)
    for stage in STAGES[1 : STAGES.index(last) + 1]:
        WORK[stage](state)


def _camera(positions: np.ndarray) -> perfect_bvh.Camera:
    low, high = positions.min(axis=0), positions.max(axis=0)
    middle, reach = (low + high) / 2, float(np.linalg.norm(high - low))
    return perfect_bvh.Camera.look_at(middle + reach * np.array((0.3, -0.6, 0.25)), middle, clip_end=10 * reach)


def _primary_rays(camera: perfect_bvh.Camera) -> np.ndarray:
    left, right, bottom, top = camera.window
    x, y = np.meshgrid(np.linspace(left, right, RAYS[0]), np.linspace(top, bottom, RAYS[1]))
    seen = np.stack([x, y, np.full_like(x, -1.0)], axis=-1).reshape(-1, 3)
    return (seen @ camera.matrix[:3, :3].T).astype(np.float32)


def _cast_primary(state: dict[str, Any]) -> None:
    origin = state["camera"].matrix[:3, 3].astype(np.float32)
    state["hits"] = state["scene"].cast_rays(origin, state["rays"], threads=1)


def _cast_diffuse(state: dict[str, Any]) -> None:
    """Casts rays from 0.999 of the distance to each hit; rays that missed start at the camera."""
    t = np.where(state["hits"].is_hit, state["hits"].t_hit, 0.0)[:, None] * np.float32(0.999)
    origins = (state["camera"].matrix[:3, 3] + state["rays"] * t).astype(np.float32)
    state["scene"].cast_rays(origins, state["directions"], threads=1)


def _render_preview(state: dict[str, Any]) -> None:
    perfect_bvh.render(state["scene"], state["camera"], mode="preview", size=IMAGE_SIZE, threads=1)


WORK: dict[str, Callable[[dict[str, Any]], object]] = {
    "commit": lambda state: state["scene"].commit(1_000_000),
    "primary": _cast_primary,
    "diffuse": _cast_diffuse,
    "preview": _render_preview,
}


def count_instructions(path: Path, last: str) -> int:
    """Counts a process that runs the stages up to `last`. Raises RuntimeError if valgrind prints no count."""
    isa = {"PERFECT_BVH_ISA": os.environ.get("PERFECT_BVH_ISA", "avx2")}
    calibration = Path(perfect_bvh.__file__).parent / "calibration.json"
    fixed = {"PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1", "PERFECT_BVH_CALIBRATION": str(calibration)}
    with tempfile.TemporaryDirectory() as folder:
        tool = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out"]
        command = [*tool, sys.executable, __file__, str(path), "--stage", last]
        done = subprocess.run(command, env=os.environ | isa | fixed, capture_output=True, text=True, check=True)
    found = re.search(r"Collected : (\d+)", done.stderr)
    if found is None:
        raise RuntimeError(f"callgrind reported no count: {done.stderr[-500:]}")
    return int(found[1])


def main() -> None:
    parser = argparse.ArgumentParser(description="Count the engine's instructions, stage by stage.")
    parser.add_argument("meshes", type=Path, nargs="+", metavar="MESH.npz", help="positions and triangles")
    parser.add_argument(
        "--json", type=Path, default=Path("counts.json"), metavar="OUT.json", help="where the counts go"
    )
    parser.add_argument("--stage", choices=STAGES, help="run the stages up to this one, and count nothing")
    chosen = parser.parse_args()
    if chosen.stage:
        run_stages(chosen.meshes[0], chosen.stage)
        return
    counts = {}
    for path in chosen.meshes:
        totals = [count_instructions(path, stage) for stage in STAGES]
        counts[path.stem] = {STAGES[i]: totals[i] - totals[i - 1] for i in range(1, len(STAGES))}
    write_rows(chosen.json, counts)


if __name__ == "__main__":
    main()
