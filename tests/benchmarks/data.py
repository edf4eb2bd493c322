"""Data sets, from .blend to files: scans and label images stage by stage, several workers, a farm on paper.

    python tests/benchmarks/data.py --json data.json

- `stages`: a scan of some frames, as `perfect-bvh scan` makes it, with what light does to beams. Seconds to open the
  file, to evaluate its frames, for the scan (evaluation included), for the same scan by a thin ray a beam, for these
  rays alone through trees that are already built, and to write each format; rays and points a second overall.
- `labels`: a room of 300 things at 640 x 480. Seconds for the labels of a frame, for its files and for COCO's; how many
  pixels two visible masks share; how many of a random part of the amodal masks differ from the thing rendered alone.
- `workers`: a longer scan by none, one and several workers, and by the same number of commands that each scan a part of
  its frames ("by hand": the most that the machine gives), all with one thread each; the time includes the start of all
  processes.
- `scheduler`: microseconds for a task that does nothing, through Dask's scheduler and one worker.
- `farm`: what 1,000 workers would saturate first, by these figures (`farm_on_paper.py`).
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import bpy
import numpy as np
from benchmarks import options
from benchmarks.farm_on_paper import Farm, saturations
from benchmarks.generated_objects import make_room
from benchmarks.machine import REPOSITORY
from benchmarks.rounds import Spread
from benchmarks.tables import format_table
from perfect_bvh_addon import label_image, scan
from perfect_bvh_addon.labels.coco import CocoFile
from perfect_bvh_addon.scanning.formats import WRITERS, save_cloud
from perfect_bvh_addon.scanning.sensor_files import load_sensor
from tqdm import tqdm

SIZE = (640, 480)
SEED = 11
EMPTY_TASKS = 2000
Row = dict[str, Any]


def main() -> None:
    """Measure, print the tables, write the JSON."""
    parser = options.parser(__doc__ or "")
    parser.add_argument("--scene", default="crowd", metavar="NAME", help="of blend_scenes")
    parser.add_argument("--sensor", default="spinning-64", metavar="NAME", help="to scan with")
    parser.add_argument("--frames", type=int, default=8, metavar="N", help="of the scan")
    parser.add_argument("--objects", type=int, default=300, metavar="N", help="in the labelled room")
    parser.add_argument("--alone", type=int, default=20, metavar="N", help="things rendered alone")
    parser.add_argument("--farm-frames", type=int, default=80, metavar="N", help="of the scan by workers")
    parser.add_argument("--workers", type=int, nargs="+", default=[2], metavar="N", help="to compare with one")
    parser.add_argument("--parts", nargs="+", choices=list(PARTS), default=list(PARTS), help="to measure")
    chosen = options.parse(parser)
    results: Row = {}
    for part in tqdm(chosen.parts, unit="part", desc="data"):
        results[part] = PARTS[part](chosen, results)
        tqdm.write(f"{part}\n{describe(results[part])}\n")
    options.save(chosen, results)


def describe(row: Row) -> str:
    """A part's figures, a line each."""
    return format_table(("figure", "value"), [[name, value] for name, value in flatten(row).items()])


def flatten(row: Row, before: str = "") -> dict[str, Any]:
    """Nested names as one."""
    flat: dict[str, Any] = {}
    for name, value in row.items():
        flat |= flatten(value, f"{before}{name} ") if isinstance(value, dict) else {f"{before}{name}": value}
    return flat


def timed(rounds: int, work: Callable[[], Any]) -> tuple[Any, float]:
    """The last result and the median of seconds."""
    times, result = [], None
    for _ in range(rounds):
        started = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - started)
    return result, Spread.of(times).median


# Scans ---------------------------------------------------------------------------------------------------------------


def measure_stages(chosen: Any, _: Row) -> Row:
    """Measures one chunk, in this process."""
    path = str(REPOSITORY / "blend_scenes" / f"{chosen.scene}.blend")
    _, opening = timed(chosen.rounds, lambda: bpy.ops.wm.open_mainfile(filepath=path))
    scene, sensor = bpy.context.scene, load_sensor(chosen.sensor)
    frames = (scene.frame_start, scene.frame_start + chosen.frames - 1)

    def evaluate() -> None:
        for frame in range(frames[0], frames[1] + 2):  # and where the last one ends
            scene.frame_set(frame)

    _, evaluating = timed(chosen.rounds, evaluate)
    cloud, scanning = timed(chosen.rounds, lambda: scan(sensor, scene.camera, frames=frames))
    _, thin = timed(chosen.rounds, lambda: scan(sensor.pattern, scene.camera, frames=frames))
    # At one moment, through trees that are already built: the rest of a frame is reading, trees and columns.
    passes = chosen.frames * frame_passes(scene, sensor.pattern)
    cast_seconds = pass_seconds(sensor.pattern, chosen.rounds) * passes
    files = {}
    with tempfile.TemporaryDirectory() as folder:
        for suffix in WRITERS:
            target = Path(folder) / f"points{suffix}"
            _, seconds = timed(chosen.rounds, lambda target=target: save_cloud(cloud, target))
            files[suffix] = {"seconds": seconds, "megabytes": target.stat().st_size / 1e6}
    whole = opening + scanning + min(file["seconds"] for file in files.values())
    rays = cloud.ray_count * (sensor.light.beam.rays if sensor.light else 1)
    return {
        "frames": chosen.frames,
        "beams": cloud.ray_count,
        "rays": rays,
        "points": len(cloud),
        "open_seconds": opening,
        "evaluate_seconds": evaluating,
        "scan_seconds": scanning,
        "thin_scan_seconds": thin,
        "thin_ray_seconds": cast_seconds,
        "files": files,
        "mrays_per_second": rays / whole / 1e6,
        "mpoints_per_second": len(cloud) / whole / 1e6,
    }


def frame_passes(scene: bpy.types.Scene, pattern: Any) -> float:
    """How many whole passes of the sensor a frame has time for."""
    return float(scene.render.fps_base / scene.render.fps / pattern.duration)


def pass_seconds(pattern: Any, rounds: int) -> float:
    """The rays of one whole pass from the camera."""
    from benchmarks.scan import cast_all
    from perfect_bvh_addon import SceneSync

    sync = SceneSync()
    sync.update(bpy.context.evaluated_depsgraph_get())
    _, seconds = timed(rounds, lambda: cast_all(pattern, sync, threads=0))
    return seconds


# Labels --------------------------------------------------------------------------------------------------------------


def measure_labels(chosen: Any, _: Row) -> Row:
    """One frame of a room."""
    things = make_room(chosen.objects, SEED)
    labels, seconds = timed(chosen.rounds, lambda: label_image(size=SIZE, layers=4))
    with tempfile.TemporaryDirectory() as folder:
        _, saving = timed(chosen.rounds, lambda: labels.save(Path(folder) / "labels.npz"))

        def write_coco() -> None:
            coco = CocoFile()
            coco.add(labels, "image.png")
            coco.save(Path(folder) / "coco.json")

        _, coco_seconds = timed(chosen.rounds, write_coco)
    covered = np.bincount(labels.visible.pixels, minlength=SIZE[0] * SIZE[1])
    return {
        "objects": chosen.objects,
        "met": len(labels.things),
        "label_seconds": seconds,
        "npz_seconds": saving,
        "coco_seconds": coco_seconds,
        "frame_seconds": seconds + saving + coco_seconds,
        "pixels_shared_by_visible_masks": int((covered > 1).sum()),
        **compare_alone(labels, things, chosen.alone),
    }


def compare_alone(labels: Any, things: list[bpy.types.Object], count: int) -> Row:
    """How many amodal masks differ from the pixels that the object covers when it is alone in the scene."""
    rows = {thing.name: row for row, thing in enumerate(labels.things)}
    chosen = np.random.default_rng(SEED).choice(len(labels.things), min(count, len(labels.things)), replace=False)
    differing = 0
    for row in chosen:
        name = labels.things[row].name
        for thing in things:
            thing.hide_render = thing.name != name
        alone = label_image(size=SIZE)
        seen = [np.sort(found.amodal.pixels_of(number)) for found, number in ((labels, rows[name]), (alone, 0))]
        differing += not np.array_equal(*seen)
    for thing in things:
        thing.hide_render = False
    return {"rendered_alone": len(chosen), "amodal_masks_that_differ": differing}


# Workers -------------------------------------------------------------------------------------------------------------


def measure_workers(chosen: Any, _: Row) -> Row:
    """The command line as users call it, start of its processes included."""
    found: dict[str, dict[str, float]] = {}
    for round_number in range(chosen.rounds):
        for workers in sorted({0, 1, *chosen.workers}):
            seconds = {str(workers): run_scans(chosen, 1, workers)}
            if workers > 1:
                seconds[f"{workers} by hand"] = run_scans(chosen, workers, 0)
            for name, took in seconds.items():
                found.setdefault(name, {})[f"round {round_number + 1}"] = took
    medians = {name: Spread.of(list(times.values())).median for name, times in found.items()}
    speedups = {f"{name} of 1": medians["1"] / seconds for name, seconds in medians.items() if name != "1"}
    return {"frames": chosen.farm_frames, "seconds": medians, "speedup": speedups, "rounds": found}


def run_scans(chosen: Any, count: int, workers: int) -> float:
    """Seconds for this number of commands at once, each with its part of the frames."""
    bounds = np.linspace(0, chosen.farm_frames, count + 1).astype(int).tolist()
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        running = [
            subprocess.Popen(scan_command(chosen, f"{folder}/{first}", f"{first + 1}-{last}", workers))
            for first, last in pairwise(bounds)
        ]
        statuses = [process.wait() for process in running]
        if any(statuses):
            raise SystemExit("a scan has failed: what it says is above")
        return time.perf_counter() - started


def scan_command(chosen: Any, output: str, frames: str, workers: int) -> list[str]:
    """`perfect-bvh scan`. workers: 0 for none."""
    program = str(Path(sys.executable).with_name("perfect-bvh"))
    blend = str(REPOSITORY / "blend_scenes" / f"{chosen.scene}.blend")
    options = ("-q", "--sensor", chosen.sensor, "--chunk", "10", "--threads", "1")
    how = ("--workers", str(workers)) if workers else ()
    return [program, "scan", blend, "-o", output, "--frames", frames, *options, *how]


def measure_scheduler(chosen: Any, _: Row) -> Row:
    """Tasks that do nothing."""
    command = [sys.executable, str(Path(__file__).with_name("empty_tasks.py")), str(EMPTY_TASKS)]
    runs = [subprocess.run(command, check=True, capture_output=True, text=True) for _ in range(chosen.rounds)]
    seconds = Spread.of([float(run.stdout) for run in runs]).median
    return {"tasks": EMPTY_TASKS, "microseconds_a_task": 1e6 * seconds / EMPTY_TASKS}


def on_paper(chosen: Any, results: Row) -> Row:
    """Calculates the farm from the figures of this run."""
    if not {"stages", "scheduler"} <= results.keys():
        raise SystemExit("the farm on paper goes by the figures of stages and scheduler: measure those as well")
    stages = results["stages"]
    farm = Farm(
        piece_seconds=stages["scan_seconds"] + stages["files"][".npz"]["seconds"],
        piece_megabytes=stages["files"][".npz"]["megabytes"],
        task_microseconds=results["scheduler"]["microseconds_a_task"],
        scene_megabytes=(REPOSITORY / "blend_scenes" / f"{chosen.scene}.blend").stat().st_size / 1e6,
    )
    return saturations(farm)


PARTS: dict[str, Callable[[Any, Row], Row]] = {
    "stages": measure_stages,
    "labels": measure_labels,
    "workers": measure_workers,
    "scheduler": measure_scheduler,
    "farm": on_paper,
}

if __name__ == "__main__":
    main()
