"""Compares a scan of whole scenes with the same rays cast one by one by `scene.ray_cast`, and counts disagreements.

    python tests/benchmarks/scan.py --json scan.json

Every scene is scanned by its camera's grid and by a LiDAR in the camera's place. `scan_ms` is all of `scan`: the scene
read again, its trees built, the rays, the points with their attributes. `cast_ms` is the rays alone, through trees that
are already built. Blender casts a random part of the same rays (--ray-limit), once its own trees are built, and makes
no points of them. Both run on one thread; the clock is the process's own CPU time.

A ray is disputed if one of them hits and the other does not, or if their distances differ by more than a thousandth.
The double-precision reference says for how many of those the engine's answers are wrong.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import bpy
import numpy as np
import numpy.typing as npt
from benchmarks.machine import REPOSITORY, describe
from benchmarks.rounds import Spread
from benchmarks.rows import write_rows
from perfect_bvh_addon import CameraGrid, PointCloud, SceneSync, SpinningLidar, scan
from perfect_bvh_addon.extract.camera import without_scale
from perfect_bvh_addon.scanning.patterns import Rays, View
from perfect_bvh_addon.sync.records import VISIBLE_TO_CAMERA
from tqdm import tqdm

SCENES = ("courtyard", "gears", "tree_in_wind", "crowd")
PATTERNS = {
    "camera": CameraGrid(640, 360),
    "lidar": SpinningLidar(elevations=tuple(np.linspace(-25.0, 15.0, 64)), columns=3600, max_distance=200.0),
}
FARTHEST = 1e6  # for Blender, which has no infinite rays
SAME_DISTANCE = 1e-3
SEED = 7


@dataclass(frozen=True)
class WorldRays:
    """Some rays of a scan: their numbers in it, where they begin and go, and their range."""

    numbers: npt.NDArray[np.int64]
    origins: npt.NDArray[np.float64]
    directions: npt.NDArray[np.float64]  # unit vectors
    nearest: npt.NDArray[np.float64]
    farthest: npt.NDArray[np.float64]


def main() -> None:
    """Measure, print a table, write the JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--json", type=Path, required=True, metavar="OUT.json", help="where the figures go")
    add("--scene", nargs="+", default=list(SCENES), metavar="NAME", help="of blend_scenes")
    add("--rounds", type=int, default=3, metavar="N", help="scans of each kind")
    add("--ray-limit", type=int, default=4000, metavar="N", help="rays that Blender casts")
    chosen = parser.parse_args()
    rows = [
        measure(name, pattern, chosen.rounds, chosen.ray_limit)
        for name in tqdm(chosen.scene, unit="scene")
        for pattern in PATTERNS
    ]
    print_table(rows)
    write_rows(chosen.json, {"machine": describe(), "rows": rows})


def measure(name: str, kind: str, rounds: int, ray_limit: int) -> dict[str, Any]:
    """One scene and pattern."""
    bpy.ops.wm.open_mainfile(filepath=str(REPOSITORY / "blend_scenes" / f"{name}.blend"))
    pattern = PATTERNS[kind]
    clouds, scan_ms = timed(rounds, lambda: scan(pattern, threads=1, for_viewport=True))  # as `scene.ray_cast` sees it
    sync = SceneSync()
    sync.update(bpy.context.evaluated_depsgraph_get(), size=pattern.size)
    rays = world_rays(pattern, sync, ray_limit)
    _, cast_ms = timed(rounds, lambda: cast_all(pattern, sync))
    next(blender_distances(rays))  # builds its trees
    answers, blender_ms = timed(1, lambda: list(blender_distances(rays)))
    distances = np.array(answers[0])
    cloud = clouds[0]
    ours = distances_of(cloud, rays)
    disputed = np.flatnonzero(~np.isclose(ours, distances, rtol=SAME_DISTANCE, atol=0.0))
    # Infinite is close to infinite: two misses agree.
    wrong = wrong_of(sync, rays, disputed)
    per_ray, per_blender_ray = scan_ms.median / cloud.ray_count, blender_ms.median / len(rays.numbers)
    return {
        "scene": name,
        "pattern": kind,
        "rays": cloud.ray_count,
        "points": len(cloud),
        "triangles": int(sum(len(mesh.triangles) for mesh in sync.record.meshes)),
        "instances": len(sync.record.instances),
        "scan_ms": scan_ms.as_json(),
        "cast_ms": cast_ms.as_json(),
        "scan_mrays": 1e-3 / per_ray,
        "cast_mrays": 1e-3 * cloud.ray_count / cast_ms.median,
        "blender_rays": len(rays.numbers),
        "blender_mrays": 1e-3 / per_blender_ray,
        "times_as_fast": per_blender_ray / per_ray,
        "disputed": len(disputed),
        "ours_wrong": wrong,
    }


def timed(rounds: int, work: Callable[[], Any]) -> tuple[list[Any], Spread]:
    """Results and milliseconds of CPU time."""
    results, times = [], []
    for _ in range(rounds):
        started = time.process_time()
        results.append(work())
        times.append((time.process_time() - started) * 1e3)
    return results, Spread.of(times)


# The same rays -------------------------------------------------------------------------------------------------------


def all_rays(pattern: CameraGrid | SpinningLidar, sync: SceneSync) -> tuple[Rays, npt.NDArray[np.float64]]:
    """A scan's rays in the camera's own space, and the way from there to the world."""
    camera = bpy.context.scene.camera.evaluated_get(bpy.context.evaluated_depsgraph_get())
    matrix = without_scale(np.array(camera.matrix_world, dtype=np.float64))
    assert matrix is not None
    view = None
    if sync.camera is not None:
        view = View(sync.camera.window, sync.camera.projection, sync.camera.clip_start, sync.camera.clip_end)
    return pattern.cast(0.0, pattern.duration, view), matrix


def world_rays(pattern: CameraGrid | SpinningLidar, sync: SceneSync, limit: int) -> WorldRays:
    """Returns at most `limit` of a scan's rays, chosen at random."""
    rays, matrix = all_rays(pattern, sync)
    rng = np.random.default_rng(SEED)
    numbers = np.sort(rng.choice(len(rays), min(limit, len(rays)), replace=False))
    directions = rays.directions[numbers] @ matrix[:3, :3].T
    lengths = np.linalg.norm(directions, axis=1)
    return WorldRays(
        numbers=numbers,
        origins=rays.origins[numbers] @ matrix[:3, :3].T + matrix[:3, 3],
        directions=directions / lengths[:, None],
        nearest=rays.t_min * lengths,
        farthest=np.minimum(rays.t_max * lengths, FARTHEST),
    )


def cast_all(pattern: CameraGrid | SpinningLidar, sync: SceneSync, threads: int = 1) -> object:
    """The rays of a scan through trees that are there."""
    rays, matrix = all_rays(pattern, sync)
    origins, directions = rays.origins @ matrix[:3, :3].T + matrix[:3, 3], rays.directions @ matrix[:3, :3].T
    fields = ("instance_ids", "mesh_ids", "primitive_ids", "geometric_normals", "positions", "distances")
    limits = {"t_min": rays.t_min, "t_max": rays.t_max, "mask": VISIBLE_TO_CAMERA}
    return sync.scene.cast_rays(origins, directions, **limits, fields=fields, threads=threads)


def blender_distances(rays: WorldRays) -> Iterator[float]:
    """Blender's distance along each ray, infinite where it finds nothing."""
    scene, depsgraph = bpy.context.scene, bpy.context.evaluated_depsgraph_get()
    columns = (rays.origins, rays.directions, rays.nearest, rays.farthest)
    for origin, direction, nearest, farthest in zip(*columns, strict=True):
        start = origin + direction * nearest
        hit, place, *_ = scene.ray_cast(depsgraph, start, direction, distance=farthest - nearest)
        yield float(np.linalg.norm(np.array(place) - origin)) if hit else np.inf


def distances_of(cloud: PointCloud, rays: WorldRays) -> npt.NDArray[np.float64]:
    """The scan's distance along some of its rays, infinite where it made no point."""
    found = np.full(cloud.ray_count, np.inf)
    found[cloud.ray_ids] = cloud.distances
    return found[rays.numbers]


def wrong_of(sync: SceneSync, rays: WorldRays, rows: npt.NDArray[np.int64]) -> int:
    """How many of the engine's answers along these rays are wrong, says the reference."""
    if not len(rows):
        return 0
    hits = sync.scene.cast_rays(
        rays.origins[rows],
        rays.directions[rows],
        t_min=rays.nearest[rows].astype(np.float32),
        t_max=rays.farthest[rows].astype(np.float32),
        mask=VISIBLE_TO_CAMERA,
        audit=1.0,
    )
    assert hits.audit is not None
    return len(hits.audit.wrong_rows)


def print_table(rows: list[dict[str, Any]]) -> None:
    """The figures, a row a scan."""
    titles = ("scene", "pattern", "rays", "points", "scan ms", "M/s", "cast M/s", "Blender M/s", "times", "disputed")
    print(" ".join(title.rjust(12) for title in (*titles, "wrong")))
    for row in rows:
        cells = [row["scene"], row["pattern"], f"{row['rays']:,}", f"{row['points']:,}"]
        cells.append(f"{row['scan_ms']['median']:.0f}")
        cells += [f"{row[name]:.3g}" for name in ("scan_mrays", "cast_mrays", "blender_mrays")]
        cells += [f"{row['times_as_fast']:.0f}", f"{row['disputed']}/{row['blender_rays']}", str(row["ours_wrong"])]
        print(" ".join(cell.rjust(12) for cell in cells))


if __name__ == "__main__":
    main()
