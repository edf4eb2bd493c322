"""One tree for a whole animation, beside refitting the first frame's, a new one in each frame, and the governor.

    python tests/benchmarks/animation.py --mesh dragon.npz --json animation.json

Plays the animations of .blend files (--blend), and meshes twisted, walking and bursting (--mesh), several times in a
row, on one thread. The JSON holds `animations`: name, triangles, frames (of one play), and of each way ("refit",
"governed", "animate", "rebuild") first_ms (the first commit, in which trees are built), update_ms (each of the others),
costs (visits to nodes that a ray is expected to make, by frame of the last play), mrays_per_second (in six of those
frames, of rays from all around), actions (how often what was done), and total_ms: updates, and as many rays as each
frame was told to expect, in all plays.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
import perfect_bvh
from benchmarks import options
from benchmarks.meshes import load
from benchmarks.moving_meshes import MovingMesh, bursting, twisting, walking
from benchmarks.rounds import Spread
from benchmarks.tables import format_table
from tqdm import tqdm

WAYS = ("refit", "governed", "animate", "rebuild")
SCENES = Path(__file__).resolve().parents[2] / "blend_scenes"
ANIMATIONS = ("tree_in_wind", "cloth", "zoo/crumpled_cloth", "zoo/long_refit_chain", "zoo/twist", "zoo/explosion")
SHAPES, TIMED_FRAMES = 64, 6


def main() -> None:
    """Measure, print a table, write the JSON."""
    parser = options.parser(__doc__ or "")
    add = parser.add_argument
    add("--mesh", nargs="+", type=Path, metavar="FILE", help=".npz (positions, triangles), .ply, .obj, to be moved")
    add("--blend", nargs="+", type=Path, metavar="FILE", help="animations, instead of this repository's")
    add("--frames", type=int, default=25, metavar="N", help="of one play")
    add("--plays", type=int, default=8, metavar="N", help="in a row")
    add("--rays", type=int, default=100_000, metavar="N", help="that each frame is told to expect")
    add("--timed", type=int, default=20_000, metavar="N", help="that are cast in a frame whose rays are timed")
    chosen = options.parse(parser)
    perfect_bvh.set_thread_count(1)
    rows = []
    for motion in tqdm([*animations(chosen)], unit="animation"):
        ways = {way: play(motion, way, chosen) for way in WAYS}
        rows.append(
            {"name": motion.name, "triangles": len(motion.triangles), "frames": len(motion.positions), "ways": ways}
        )
    perfect_bvh.set_thread_count(0)
    heads = ("animation", "way", "first ms", "update ms", "mean cost", "Mrays/s", "all ms", "actions")
    print(format_table(heads, [cells(row["name"], way, told) for row in rows for way, told in row["ways"].items()]))
    options.save(chosen, {"rays": chosen.rays, "plays": chosen.plays, "animations": rows})


def cells(name: str, way: str, told: dict[str, Any]) -> tuple[Any, ...]:
    """A line of the table."""
    actions = ", ".join(f"{count} {action}" for action, count in told["actions"].items())
    speed = told["mrays_per_second"]["median"]
    return (
        name,
        way,
        told["first_ms"],
        told["update_ms"],
        float(np.mean(told["costs"])),
        speed,
        told["total_ms"],
        actions,
    )


def animations(chosen: Any) -> Iterator[MovingMesh]:
    """All that was asked for."""
    from benchmarks import blend_animations

    for path in chosen.blend or [SCENES / f"{name}.blend" for name in ANIMATIONS]:
        yield from blend_animations.read(path, chosen.frames)
    for mesh in map(load, chosen.mesh or ()):
        for move in (twisting, walking, bursting):
            yield move(mesh.name, mesh.positions, mesh.triangles, chosen.frames)


def play(motion: MovingMesh, way: str, chosen: Any) -> dict[str, Any]:
    """All plays in one scene."""
    frames = np.tile(np.arange(len(motion.positions)), chosen.plays)
    scene = perfect_bvh.Scene(way)  # type: ignore[arg-type]
    mesh = scene.add_mesh(motion.positions[0], motion.triangles, usage="deforming")
    scene.add_instance(mesh)
    shapes = frames[np.linspace(0, len(frames) - 1, min(SHAPES, len(frames))).astype(int)]
    updates, costs, speeds, actions = [], [], [], Counter[str]()
    timed = set(np.linspace(0, len(motion.positions) - 1, TIMED_FRAMES).astype(int).tolist())
    for number, frame in enumerate(frames):
        if number == 0:
            scene.expect_animation(mesh, motion.positions[shapes], len(frames))
        else:
            scene.update_mesh(mesh, motion.positions[frame])
        started = time.thread_time()
        (row,) = scene.commit(chosen.rays).meshes
        updates.append((time.thread_time() - started) * 1e3)
        actions[row.action] += 1
        if number >= len(frames) - len(motion.positions):
            costs.append(row.cost)
            if frame in timed:
                speeds += [cast(scene, motion.positions[frame], chosen.timed) for _ in range(chosen.rounds)]
    speed = Spread.of(speeds)
    return {
        "first_ms": updates[0],
        "update_ms": float(np.mean(updates[1:])),
        "costs": costs,
        "mrays_per_second": speed.as_json(),
        "actions": dict(actions),
        "total_ms": sum(updates) + len(frames) * chosen.rays * float(np.mean(1.0 / np.array(speeds))) * 1e-3,
    }


def cast(scene: perfect_bvh.Scene, positions: np.ndarray, count: int) -> float:
    """Million rays a second, from all around towards random places in the mesh's box."""
    random = np.random.default_rng(5)
    lower, upper = positions.min(axis=0).astype(np.float64), positions.max(axis=0).astype(np.float64)
    outward = random.normal(size=(count, 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    origins = (lower + upper) / 2 + outward * np.linalg.norm(upper - lower)
    directions = random.uniform(lower, upper, (count, 3)) - origins
    started = time.thread_time()
    scene.cast_rays(origins, directions, fields=("t_hit",), threads=1)
    return count / (time.thread_time() - started) * 1e-6


if __name__ == "__main__":
    main()
