"""How far an image is from its converged self, against the time that it took: preview and clay, and Cycles beside them.

    python tests/benchmarks/image_error.py --json image_error.json

The scene gets one matt material and a white sky and loses its lamps; light bounces once: so the preview and Cycles
integrate nearly the same; how far their converged images are apart is written, too. Each renderer's error is the root
of the mean square difference from its own image of 4,096 samples of other random numbers, over that image's mean.
Same threads, same pixel filter, no denoiser, no adaptive sampling. Times are the wall's, of sync and rays apart.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import bpy
import numpy as np
import numpy.typing as npt
import perfect_bvh
from benchmarks.machine import REPOSITORY, describe
from benchmarks.rounds import Spread
from oracles.cycles import preserved, read_passes, write_multilayer
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.sync.records import AttributeRequest
from tqdm import tqdm

Image = npt.NDArray[np.float32]
Render = Callable[[int, int], tuple[Image, float]]  # samples, seed -> image, milliseconds
CONVERGED = 4096
FILTER_WIDTH = 1.5  # of the pixel filter in Cycles: the default, as ours is
REFERENCE_SEED = 1000


def main() -> None:
    """Measure, write the JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--json", type=Path, required=True, metavar="OUT.json", help="where the figures go")
    add("--scene", default="courtyard", help="of blend_scenes")
    add("--size", type=int, default=80, metavar="W", help="of the image, 16:9")
    add("--most", type=int, default=256, metavar="N", help="samples a pixel at most")
    add("--seeds", type=int, default=3, metavar="N", help="images of each number of samples")
    chosen = parser.parse_args()
    bpy.ops.wm.open_mainfile(filepath=str(REPOSITORY / "blend_scenes" / f"{chosen.scene}.blend"))
    scene = bpy.context.scene
    simplify(scene)
    runs, converged = [], {}
    with tqdm(unit="image") as bar:
        for name, width, render, sync_ms in renderers(scene, chosen.size):
            bar.set_description(name)
            row, reference = measure(render, chosen.most, chosen.seeds, bar)
            runs.append({"name": name, "width": width, "sync_ms": sync_ms, **row})
            converged[name] = reference
    runs = [split_sync(run) for run in runs]
    apart = error(converged["preview"], converged["Cycles"])
    figures = {"scene": chosen.scene, "preview_from_cycles": apart, "runs": runs}
    chosen.json.parent.mkdir(parents=True, exist_ok=True)
    chosen.json.write_text(json.dumps({"machine": describe(), **figures}, indent=1) + "\n", encoding="utf-8")


def simplify(scene: bpy.types.Scene) -> None:
    """One matt material, a white sky, no lamps."""
    matt = bpy.data.materials.new("Matt")
    matt.use_nodes = True
    nodes = matt.node_tree.nodes
    nodes.clear()
    diffuse, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (0.8, 0.8, 0.8, 1.0)
    matt.node_tree.links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
    scene.view_layers[0].material_override = matt
    for lamp in [each for each in scene.objects if each.type == "LIGHT"]:
        bpy.data.objects.remove(lamp)
    world = bpy.data.worlds.new("White")
    world.use_nodes = True
    background = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    scene.world = world
    scene.render.resolution_percentage = 100
    scene.render.use_motion_blur = False
    scene.camera.data.dof.use_dof = False


def renderers(scene: bpy.types.Scene, width: int) -> Any:
    """Name, width of the image, how to render, milliseconds of the sync (None: part of each render)."""
    ours = Ours(scene)
    reach = ours.reach
    yield "preview", width, ours.render("preview", width, smooth=False), ours.milliseconds
    yield "preview, smoothed", width, ours.render("preview", width, smooth=True), ours.milliseconds
    yield "Cycles", width, in_cycles(scene, width), None
    for share in (1.0, 0.25, 0.0625):
        name = "clay" if share == 1.0 else f"clay, {share:g} of the radius"
        yield name, width, ours.render("clay", width, smooth=False, ao_distance=reach * share), ours.milliseconds
    for wide in (width // 2, width * 3 // 2):
        yield (
            f"clay, {wide} pixels wide",
            wide,
            ours.render("clay", wide, smooth=False, ao_distance=reach),
            ours.milliseconds,
        )


class Ours:
    """The scene in this engine. reach: the clay's radius of occlusion that it chooses by itself."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        sync = SceneSync(attributes=AttributeRequest(material_slots=True, corner_normals=True, shading=True))
        depsgraph = bpy.context.evaluated_depsgraph_get()
        started = time.perf_counter()
        sync.update(depsgraph)
        self.milliseconds = (time.perf_counter() - started) * 1e3
        # What is kept of it stays as it is while Cycles renders.
        self.snapshot, self.camera, self.appearance = sync.scene.snapshot(), sync.camera, sync.appearance
        record = sync.record
        places = record.instances.transforms[:, :, 3]
        self.reach = 0.05 * float(np.linalg.norm(np.ptp(places, axis=0)))

    def render(self, mode: str, width: int, **options: Any) -> Render:
        def run(samples: int, seed: int) -> tuple[Image, float]:
            started = time.perf_counter()
            size = (width, width * 9 // 16)
            keywords = {"appearance": self.appearance, "seed": seed, **options}
            image = perfect_bvh.render(self.snapshot, self.camera, mode, size, samples, **keywords)
            return image, (time.perf_counter() - started) * 1e3

        return run


def in_cycles(scene: bpy.types.Scene, width: int) -> Render:
    """The same integrand by Cycles on as many threads."""
    cycles, render = scene.cycles, scene.render
    settings = [
        (cycles, "device", "CPU"), (cycles, "use_adaptive_sampling", False), (cycles, "use_denoising", False),
        (cycles, "max_bounces", 1), (cycles, "diffuse_bounces", 1), (cycles, "sample_clamp_indirect", 0.0),
        (cycles, "sample_clamp_direct", 0.0), (cycles, "filter_width", FILTER_WIDTH),
        (cycles, "pixel_filter_type", "BLACKMAN_HARRIS"), (render, "threads_mode", "FIXED"),
        (render, "threads", perfect_bvh.thread_count()), (render, "resolution_x", width),
        (render, "resolution_y", width * 9 // 16), (render, "use_persistent_data", False),
    ]  # fmt: skip

    def run(samples: int, seed: int) -> tuple[Image, float]:
        with (
            tempfile.TemporaryDirectory() as folder,
            preserved(*settings, (cycles, "samples", samples), (cycles, "seed", seed)),
        ):
            path = Path(folder) / "image.exr"
            started = time.perf_counter()
            write_multilayer(path, scene, "CYCLES")
            taken = (time.perf_counter() - started) * 1e3
            return read_passes(path, scene.view_layers[0].name).combined, taken

    return run


def measure(render: Render, most: int, seeds: int, bar: tqdm[Any]) -> tuple[dict[str, Any], Image]:
    """Errors and times of 1, 2, 4 ... samples; and the converged image."""
    reference, milliseconds = render(CONVERGED, REFERENCE_SEED)
    points = []
    samples = 1
    while samples <= most:
        errors, times = [], []
        for seed in range(seeds):
            image, taken = render(samples, seed)
            errors.append(error(image, reference))
            times.append(taken)
            bar.update()
        points.append({"samples": samples, "error": Spread.of(errors).as_json(), "ms": Spread.of(times).as_json()})
        samples *= 4
    return {"converged_ms": milliseconds, "points": points}, reference


def error(image: Image, reference: Image) -> float:
    """Root of the mean square difference of the colours, as a share of the reference's mean."""
    wanted = reference[..., :3].astype(np.float64)
    return float(np.sqrt(np.mean((image[..., :3] - wanted) ** 2)) / wanted.mean())


def split_sync(run: dict[str, Any]) -> dict[str, Any]:
    """Of a renderer that reads the scene in each render: what of the time does not grow with the samples."""
    run["reads_each_time"] = run["sync_ms"] is None
    if run["reads_each_time"]:
        samples = np.array([CONVERGED, *(point["samples"] for point in run["points"])], float)
        times = np.array([run["converged_ms"], *(point["ms"]["median"] for point in run["points"])])
        slope = np.polyfit(samples, times, 1)[0]
        run["sync_ms"] = max(0.0, float(np.median(times[1:] - slope * samples[1:])))
        for point in run["points"]:
            point["ms"] = {
                key: max(value - run["sync_ms"], slope * point["samples"]) for key, value in point["ms"].items()
            }
    return run


if __name__ == "__main__":
    main()
