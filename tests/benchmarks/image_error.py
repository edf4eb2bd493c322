"""The error of images against Cycles' converged one, over the time that they took: ours and Cycles', raw and denoised.

    python tests/benchmarks/image_error.py --json image_error.json
    python tests/benchmarks/image_error.py --json image_error.json --scenes FILE.blend ...

Each scene is rendered without motion blur, by its own light paths and view transform. All images are whole renders in
Blender, from the request to the file, of a scene that neither engine has seen before; all take turns. Each engine
denoises as its own settings do by default. Errors are measured after the view transform: the root of the mean square
difference from the converged image, in parts of 255. The converged image is the mean of two halves of different noise;
their difference says how much noise is left in it, and errors are without that. CPU seconds are those of all threads.
Where the package flip-evaluator is installed, images are compared by FLIP as well, which includes that noise. The JSON
is written again after each scene.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
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
from benchmarks.tables import Cell, format_table
from oracles.cycles import preserved
from perfect_bvh_addon.live.sync_cache import clear_syncs
from tqdm import tqdm

Image = npt.NDArray[np.float32]
SCENES = REPOSITORY / "blend_scenes"
REFERENCE_SEED = 1000
ASKED = (4, 16)  # numbers of Cycles' samples whose error ours is to reach
LEAST_ERROR = 0.01  # in parts of 255: smaller errors cannot be distinguished from the reference's noise
MOST_BEYOND = 100.0  # times the longest measured: an error that more samples would not reach counts as this
HAS_FLIP = importlib.util.find_spec("flip_evaluator") is not None
MEASURES = ("error", "flip") if HAS_FLIP else ("error",)


@dataclass(frozen=True, slots=True)
class Renderer:
    """One method of rendering an image."""

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
    """An image after the view transform, (H, W, 3), and its cost."""

    image: Image
    wall: float
    cpu: float


def main() -> None:
    """Measure, write the JSON, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--json", type=Path, required=True, metavar="OUT.json", help="where the figures go")
    add(
        "--scenes",
        nargs="+",
        default=sorted(path.stem for path in SCENES.glob("*.blend")),
        help="names in blend_scenes, or paths of .blend files",
    )
    add("--size", type=int, default=480, metavar="W", help="of the images, 16:9")
    add("--most", type=int, default=64, metavar="N", help="samples a pixel at most")
    add("--seeds", type=int, default=3, metavar="N", help="images of each number of samples")
    add("--converged", type=int, default=2048, metavar="N", help="Cycles' samples of what images are compared with")
    add("--denoised", action="store_true", help="leave out images that are not denoised")
    add("--truths", type=Path, metavar="DIR", help="where converged images are kept, and found again")
    chosen = parser.parse_args()
    perfect_bvh_addon.register()
    counts = [2**power for power in range(chosen.most.bit_length()) if 2**power <= chosen.most]
    renderers = tuple(which for which in RENDERERS if which.denoises or not chosen.denoised)
    steps = len(chosen.scenes) * (1 + len(counts) * chosen.seeds * len(renderers))
    with tqdm(total=steps, unit="image") as bar:
        scenes: list[dict[str, Any]] = []
        for name in chosen.scenes:
            scenes.append(measure(file_of(name), chosen, renderers, counts, bar))
            figures = {"width": chosen.size, "converged_samples": chosen.converged, **compare(scenes)}
            write_rows(chosen.json, {"machine": describe(), **figures})
    print(format_comparison(figures))


def file_of(scene: str) -> Path:
    """Return the file of a scene: a path of a .blend file, or a name in blend_scenes."""
    return Path(scene) if scene.endswith(".blend") else SCENES / f"{scene}.blend"


def measure(
    file: Path, chosen: argparse.Namespace, renderers: Sequence[Renderer], counts: list[int], bar: tqdm[Any]
) -> dict[str, Any]:
    """Return the figures of each renderer for one scene."""
    name, width, seeds = file.stem, chosen.size, chosen.seeds
    bar.set_description(name)
    bpy.ops.wm.open_mainfile(filepath=str(file))
    scene = bpy.context.scene
    truth, noise, converged = converge(scene, name, chosen)
    bar.update()
    taken: dict[tuple[str, int], list[dict[str, float]]] = defaultdict(list)
    for samples in counts:
        for seed in range(seeds):
            for turn in range(len(renderers)):
                which = renderers[(turn + seed) % len(renderers)]
                made = render(scene, which, width, samples, seed)
                taken[which.name, samples].append(figures_of(made, truth, noise))
                bar.update()
    return {
        "name": name,
        "converged_samples": converged,
        "converged_noise": noise,
        "runs": [
            {"name": which.name, "points": [point_of(n, taken[which.name, n]) for n in counts]} for which in renderers
        ],
    }


def converge(scene: bpy.types.Scene, name: str, chosen: argparse.Namespace) -> tuple[Image, float, int]:
    """Return Cycles' image of the asked samples or more, its noise in parts of 255, and how many samples it has."""
    kept = {}
    if chosen.truths is not None:
        kept = {int(path.stem.rsplit("_", 1)[1]): path for path in chosen.truths.glob(f"{name}_{chosen.size}_*.npy")}
    most = max(kept, default=0)
    if most >= chosen.converged:
        return *mean_of(np.load(kept[most])), most
    halves = np.stack(
        [
            render(scene, RENDERERS[2], chosen.size, samples, REFERENCE_SEED + half).image
            for half, samples in enumerate((chosen.converged // 2, chosen.converged - chosen.converged // 2))
        ]
    )
    if chosen.truths is not None:
        chosen.truths.mkdir(parents=True, exist_ok=True)
        np.save(chosen.truths / f"{name}_{chosen.size}_{chosen.converged}.npy", halves)
    return *mean_of(halves), chosen.converged


def mean_of(halves: Image) -> tuple[Image, float]:
    """Return the mean of two images of different noise, (2, H, W, 3), and the noise of the mean in parts of 255.

    A single image, (H, W, 3), is returned with no noise, as nothing is known of it.
    """
    if halves.ndim == 3:
        return halves, 0.0
    return halves.mean(axis=0), error(*halves) / 2.0


def render(scene: bpy.types.Scene, which: Renderer, width: int, samples: int, seed: int) -> Rendered:
    """Times a render from the request to the file, without data kept from earlier renders."""
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
    """(owner, property, value) of the settings that make a scene's images comparable."""
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


def error(image: Image, truth: Image, noise: float = 0.0) -> float:
    """Return the root of the mean square difference, in parts of 255, without the truth's own noise."""
    square = 255.0**2 * float(np.mean((image.astype(np.float64) - truth) ** 2))
    return math.sqrt(max(square - noise**2, LEAST_ERROR**2))


def flip(image: Image, truth: Image) -> float:
    """Return the mean of FLIP's error map, 0 to 1, at its default viewing distance."""
    import flip_evaluator

    return float(flip_evaluator.evaluate(np.ascontiguousarray(truth), np.ascontiguousarray(image), "LDR")[1])


def figures_of(made: Rendered, truth: Image, noise: float) -> dict[str, float]:
    """Return the errors of an image and the seconds it took."""
    figures = {"error": error(made.image, truth, noise), "cpu": made.cpu, "wall": made.wall}
    return figures | {"flip": flip(made.image, truth)} if HAS_FLIP else figures


def point_of(samples: int, taken: list[dict[str, float]]) -> dict[str, Any]:
    """Return the spread of each figure over the images of a number of samples."""
    return {"samples": samples} | {key: Spread.of([figures[key] for figures in taken]).as_json() for key in taken[0]}


def compare(scenes: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the scenes with the two comparisons over all of them: CPU time to equal error, error at equal CPU time."""
    most = max(point["samples"] for scene in scenes for point in scene["runs"][0]["points"])
    asked = [samples for samples in ASKED if samples <= most]
    return {
        "scenes": scenes,
        "cpu_to_equal_error": {str(samples): shares(scenes, samples) for samples in asked},
        "error_at_equal_cpu": {str(samples): errors_beside(scenes, samples) for samples in asked},
    }


def denoised(scene: dict[str, Any], samples: int) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Return all our denoised points, and Cycles' denoised one of a number of samples."""
    runs = {run["name"]: run["points"] for run in scene["runs"]}
    (theirs,) = (point for point in runs["Cycles, denoised"] if point["samples"] == samples)
    return runs["ours, denoised"], theirs


def shares(scenes: list[dict[str, Any]], samples: int) -> dict[str, Any]:
    """Our CPU time to the error of this number of Cycles' samples, relative to Cycles' time; both denoised."""
    by_scene = {}
    for scene in scenes:
        ours, theirs = denoised(scene, samples)
        by_scene[scene["name"]] = cpu_at(ours, theirs["error"]["median"]) / theirs["cpu"]["median"]
    return {"scenes": by_scene, "geometric_mean": geometric_mean(by_scene.values())}


def errors_beside(scenes: list[dict[str, Any]], samples: int) -> dict[str, Any]:
    """Return our error in parts of Cycles' at the CPU time of its samples, by measure; both denoised."""
    found = {}
    for kind in MEASURES:
        by_scene = {}
        for scene in scenes:
            ours, theirs = denoised(scene, samples)
            at = error_at(ours, theirs["cpu"]["median"], kind)
            by_scene[scene["name"]] = None if at is None else at / theirs[kind]["median"]
        known = [ratio for ratio in by_scene.values() if ratio is not None]
        found[kind] = {
            "scenes": by_scene,
            "geometric_mean": geometric_mean(known) if known else None,
            "nearer": sum(ratio < 1.0 for ratio in known),
        }
    return found


def geometric_mean(values: Iterable[float]) -> float:
    """Return the geometric mean of positive values."""
    return math.exp(float(np.mean([math.log(value) for value in values])))


def error_at(points: list[dict[str, Any]], cpu: float, kind: str) -> float | None:
    """Return the error at a CPU time: between measured ones along straight lines of logarithms, later the last.

    None before the first: nothing is that fast.
    """
    times = np.maximum.accumulate([math.log(point["cpu"]["median"]) for point in points])
    if math.log(cpu) < times[0]:
        return None
    return math.exp(float(np.interp(math.log(cpu), times, [math.log(point[kind]["median"]) for point in points])))


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
            return math.exp(min(times[first] + slope * (target - errors[first]), times[-1] + math.log(MOST_BEYOND)))
    return math.exp(times[-1])


def format_comparison(figures: dict[str, Any]) -> str:
    """Return a table of the denoised images, a line for each scene, and how many are nearer to the truth by ours."""
    shares_of, beside = figures["cpu_to_equal_error"], figures["error_at_equal_cpu"]
    if not shares_of:
        return f"The table needs --most {ASKED[0]} or more."
    last = list(beside)[-1]
    heads = ["scene", *(f"Cycles' error, {samples}" for samples in shares_of)]
    heads += [f"our CPU to it, {samples}" for samples in shares_of]
    heads += [f"our {kind} at the CPU of {last}" for kind in beside[last]]
    lines: list[list[Cell]] = []
    for scene in figures["scenes"]:
        name = scene["name"]
        line: list[Cell] = [name, *(denoised(scene, int(samples))[1]["error"]["median"] for samples in shares_of)]
        line += [share["scenes"][name] for share in shares_of.values()]
        lines.append(line + [ratio["scenes"][name] for ratio in beside[last].values()])
    means: list[Cell] = ["geometric mean", *([None] * len(shares_of))]
    means += [share["geometric_mean"] for share in (*shares_of.values(), *beside[last].values())]
    nearer = [f"{ratio['nearer']} of {len(lines)} by {kind}" for kind, ratio in beside[last].items()]
    return (
        f"{format_table(heads, [*lines, means])}\n"
        "CPU times and our errors are in parts of Cycles'. At equal CPU time ours is nearer in " + ", ".join(nearer)
    )


if __name__ == "__main__":
    main()
