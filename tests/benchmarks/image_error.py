"""How far images are from Cycles' converged one, against the time that they took: ours and Cycles', raw and denoised.

    python tests/benchmarks/image_error.py --json image_error.json

Each example scene as it is but for motion blur, by its own light paths and view transform. All images are whole renders
in Blender, from the request to the file, of a scene that neither engine knows anything of; all take turns. Each engine
denoises as its own settings do by default. Errors are of what is seen: the root of the mean square difference from the
converged image after the view transform, in parts of 255. CPU seconds are those of all threads.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
import time
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import bpy
import numpy as np
import numpy.typing as npt
import perfect_bvh
import perfect_bvh_addon
from benchmarks.machine import REPOSITORY, describe
from benchmarks.rounds import Spread
from benchmarks.rows import write_rows
from oracles.cycles import preserved
from perfect_bvh_addon.live.sync_cache import clear_syncs
from tqdm import tqdm

Image = npt.NDArray[np.float32]
SCENES = REPOSITORY / "blend_scenes"
REFERENCE_SEED = 1000
ASKED = (4, 16)  # numbers of Cycles' samples whose error ours is to reach


@dataclass(frozen=True, slots=True)
class Renderer:
    """One way to an image."""

    name: str
    engine: str
    denoises: bool


RENDERERS = (
    Renderer("ours", "PERFECT_BVH", False),
    Renderer("ours, denoised", "PERFECT_BVH", True),
    Renderer("Cycles", "CYCLES", False),
    Renderer("Cycles, denoised", "CYCLES", True),
)


@dataclass(frozen=True, slots=True)
class Rendered:
    """An image as it is seen, (H, W, 3), and what it took."""

    image: Image
    wall: float
    cpu: float


def main() -> None:
    """Measure, write the JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--json", type=Path, required=True, metavar="OUT.json", help="where the figures go")
    add("--scenes", nargs="+", default=sorted(path.stem for path in SCENES.glob("*.blend")), help="of blend_scenes")
    add("--size", type=int, default=480, metavar="W", help="of the images, 16:9")
    add("--most", type=int, default=64, metavar="N", help="samples a pixel at most")
    add("--seeds", type=int, default=3, metavar="N", help="images of each number of samples")
    add("--converged", type=int, default=2048, metavar="N", help="Cycles' samples of what images are compared with")
    add("--truths", type=Path, metavar="DIR", help="where converged images are kept, and found again")
    chosen = parser.parse_args()
    perfect_bvh_addon.register()
    counts = [2**power for power in range(chosen.most.bit_length()) if 2**power <= chosen.most]
    steps = len(chosen.scenes) * (1 + len(counts) * chosen.seeds * len(RENDERERS))
    with tqdm(total=steps, unit="image") as bar:
        scenes = [measure(name, chosen, counts, bar) for name in chosen.scenes]
    figures = {
        "width": chosen.size,
        "converged_samples": chosen.converged,
        "scenes": scenes,
        "cpu_to_equal_error": {str(samples): shares(scenes, samples) for samples in ASKED if samples <= chosen.most},
    }
    write_rows(chosen.json, {"machine": describe(), **figures})


def measure(name: str, chosen: argparse.Namespace, counts: list[int], bar: tqdm[Any]) -> dict[str, Any]:
    """One scene: the figures of each renderer."""
    width, seeds = chosen.size, chosen.seeds
    bar.set_description(name)
    bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{name}.blend"))
    scene = bpy.context.scene
    truth, converged = converge(scene, name, chosen)
    bar.update()
    taken: dict[tuple[str, int], list[tuple[float, Rendered]]] = defaultdict(list)
    for samples in counts:
        for seed in range(seeds):
            for turn in range(len(RENDERERS)):
                which = RENDERERS[(turn + seed) % len(RENDERERS)]
                made = render(scene, which, width, samples, seed)
                taken[which.name, samples].append((error(made.image, truth), made))
                bar.update()
    return {
        "name": name,
        "converged_samples": converged,
        "runs": [
            {"name": which.name, "points": [point_of(n, taken[which.name, n]) for n in counts]} for which in RENDERERS
        ],
    }


def converge(scene: bpy.types.Scene, name: str, chosen: argparse.Namespace) -> tuple[Image, int]:
    """Cycles' image of at least as many samples as were asked for, the best that is kept, and how many it has."""
    if chosen.truths is None:
        return render(scene, RENDERERS[2], chosen.size, chosen.converged, REFERENCE_SEED).image, chosen.converged
    kept = {int(path.stem.rsplit("_", 1)[1]): path for path in chosen.truths.glob(f"{name}_{chosen.size}_*.npy")}
    most = max(kept, default=0)
    if most >= chosen.converged:
        return np.load(kept[most]), most
    image = render(scene, RENDERERS[2], chosen.size, chosen.converged, REFERENCE_SEED).image
    chosen.truths.mkdir(parents=True, exist_ok=True)
    np.save(chosen.truths / f"{name}_{chosen.size}_{chosen.converged}.npy", image)
    return image, chosen.converged


def render(scene: bpy.types.Scene, which: Renderer, width: int, samples: int, seed: int) -> Rendered:
    """From the request to a file, with nothing kept from before."""
    clear_syncs()
    picture = scene.render.image_settings
    settings: list[tuple[Any, str, Any]] = settings_of(scene, which, width, samples, seed)
    if hasattr(picture, "media_type"):
        settings.append((picture, "media_type", "IMAGE"))
    settings += [(picture, "file_format", "PNG"), (picture, "color_mode", "RGB"), (picture, "color_depth", "16")]
    with tempfile.TemporaryDirectory() as folder, preserved(*settings):
        path = Path(folder) / "image.png"
        with preserved((scene.render, "filepath", str(path))):
            started, worked = time.perf_counter(), time.process_time()
            bpy.ops.render.render(write_still=True)
            wall, cpu = time.perf_counter() - started, time.process_time() - worked
        return Rendered(read(path), wall, cpu)


def settings_of(
    scene: bpy.types.Scene, which: Renderer, width: int, samples: int, seed: int
) -> list[tuple[Any, str, Any]]:
    """(owner, property, value) of what makes a scene's images comparable."""
    ours, cycles = scene.perfect_bvh, scene.cycles
    return [
        (scene.render, "engine", which.engine), (scene.render, "use_persistent_data", False),
        (scene.render, "resolution_x", width), (scene.render, "resolution_y", width * 9 // 16),
        (scene.render, "resolution_percentage", 100), (scene.render, "use_motion_blur", False),
        (scene.render, "threads_mode", "FIXED"),
        (scene.render, "threads", perfect_bvh.thread_count()), (scene.render, "use_file_extension", False),
        (ours, "mode", "PREVIEW"), (ours, "samples", samples), (ours, "seed", seed),
        (ours, "use_noise_threshold", False), (ours, "use_denoising", which.denoises),
        (cycles, "device", "CPU"), (cycles, "samples", samples), (cycles, "seed", seed),
        (cycles, "use_adaptive_sampling", False), (cycles, "use_denoising", which.denoises),
        (cycles, "denoiser", "OPENIMAGEDENOISE"),
    ]  # fmt: skip


def read(path: Path) -> Image:
    """(H, W, 3) of a file's numbers, 0 to 1."""
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)[..., :3]


def error(image: Image, truth: Image) -> float:
    """Root of the mean square difference, in parts of 255."""
    return 255.0 * float(np.sqrt(np.mean((image.astype(np.float64) - truth) ** 2)))


def point_of(samples: int, taken: list[tuple[float, Rendered]]) -> dict[str, Any]:
    """What the figures hold of a number of samples."""
    return {
        "samples": samples,
        "error": Spread.of([wrong for wrong, _ in taken]).as_json(),
        "cpu": Spread.of([made.cpu for _, made in taken]).as_json(),
        "wall": Spread.of([made.wall for _, made in taken]).as_json(),
    }


def shares(scenes: list[dict[str, Any]], samples: int) -> dict[str, Any]:
    """Our CPU time to the error of so many of Cycles' samples, in parts of its own; both denoised."""
    by_scene = {}
    for scene in scenes:
        runs = {run["name"]: run["points"] for run in scene["runs"]}
        (theirs,) = (point for point in runs["Cycles, denoised"] if point["samples"] == samples)
        cpu = cpu_at(runs["ours, denoised"], theirs["error"]["median"])
        by_scene[scene["name"]] = cpu / theirs["cpu"]["median"]
    mean = math.exp(sum(map(math.log, by_scene.values())) / len(by_scene))
    return {"scenes": by_scene, "geometric_mean": mean}


def cpu_at(points: list[dict[str, Any]], wanted: float) -> float:
    """CPU seconds to an error: between measured ones along straight lines of logarithms, beyond them as the last."""
    errors = [math.log(point["error"]["median"]) for point in points]
    times = [math.log(point["cpu"]["median"]) for point in points]
    target = math.log(wanted)
    for first in range(len(points) - 1):
        if errors[first] <= target:
            return math.exp(times[first])
        if errors[first + 1] <= target or first + 2 == len(points):
            slope = (times[first + 1] - times[first]) / min(errors[first + 1] - errors[first], -1e-9)
            return math.exp(times[first] + slope * (target - errors[first]))
    return math.exp(times[-1])


if __name__ == "__main__":
    main()
