"""python tests/wine/time_engine.py RECORD FIGURES.json: how fast the engine is here.

For `tests/benchmarks/windows.py`, which calls it on both systems by turns.

Measures one thread's work in this process's CPU time, which other processes do not affect. Systems count it in steps of
10 or 16 milliseconds, so work shorter than half a second is repeated.
"""

from __future__ import annotations

import json
import pickle
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
import perfect_bvh
from hit_table import shapes
from hit_table.hashing import between
from perfect_bvh_addon.sync.appearance import as_camera, make_appearance
from perfect_bvh_addon.sync.state import SceneState

RAYS = 200_000
SAMPLES = 4
LEAST_SECONDS = 0.5


def seconds_of(call: Callable[[], object]) -> float:
    """Returns the seconds of one call, after one that warms up."""
    call()
    started, calls = time.process_time(), 0
    while time.process_time() - started < LEAST_SECONDS:
        call()
        calls += 1
    return (time.process_time() - started) / calls


def time_kernels() -> dict[str, float]:
    """Returns, by instruction set and kind of ray, seconds of RAYS rays through a hall of 400,000 triangles."""
    scene = perfect_bvh.Scene()
    for positions, triangles in (shapes.ball(7), shapes.terrain(256, 1), shapes.soup(100_000, 2)):
        scene.add_instance(scene.add_mesh(positions, triangles))
    scene.commit()
    scattered = between(-2, 2, (RAYS, 3), 3), between(-1, 1, (RAYS, 3), 4)
    side = np.linspace(-0.5, 0.5, int(RAYS**0.5))
    x, y = np.meshgrid(side, side)
    primary = np.broadcast_to((0.0, 0.0, 3.0), (x.size, 3)), np.stack([x.ravel(), y.ravel(), -np.ones(x.size)], axis=1)
    figures = {}
    for isa in perfect_bvh.available_isas():
        perfect_bvh.set_active_isa(isa)
        for name, rays in (("primary", primary), ("scattered", scattered)):
            trace = partial(scene.cast_rays, *rays, fields=("t_hit",), threads=1)
            figures[f"{isa} {name}"] = seconds_of(trace)
    perfect_bvh.set_active_isa(None)
    return figures


def time_images(file: Path) -> dict[str, float]:
    """Seconds of a scene's trees and of three images of it."""
    record = pickle.loads(file.read_bytes())
    figures = {"trees of the scene": seconds_of(lambda: SceneState(perfect_bvh.Scene).update(record))}
    state = SceneState(perfect_bvh.Scene)
    state.update(record)
    appearance = make_appearance(record, state.instance_ids, state.mesh_ids)
    camera = as_camera(record.camera)
    options = {"size": record.size, "samples": SAMPLES, "appearance": appearance, "threads": 1}
    for mode in ("preview", "clay", "normal"):
        make = partial(perfect_bvh.render, state.scene, camera, mode=mode, **options)
        figures[f"render {mode}"] = seconds_of(make)
    return figures


if __name__ == "__main__":
    record, output = (Path(argument).resolve() for argument in sys.argv[1:])
    output.write_text(json.dumps(time_kernels() | time_images(record)), encoding="utf-8")
