"""How far an image is from its converged self, against the time that it took: preview and clay, and Cycles beside them.

    python tests/benchmarks/image_error.py --json image_error.json

The scene gets one diffuse material and a white sky and loses its lamps; light bounces once. What it bounces off gets a
fixed share of the sky in the preview, and so it does in Cycles: by its fast global illumination, with rays too short to
meet anything. How far the two converged images are apart is written, too. Times are those of whole images.
Errors are those of the middle of each, a fifth as wide and high: only that is rendered with 4,096 samples of other
random numbers to compare with. They are the root of the mean square difference from it, over its mean.
Same threads, same pixel filter, no denoiser, no adaptive sampling. Times are the wall's. All renderers take turns.
What a render in Blender takes beside its rays (Blender evaluates the scene, it is read, trees are built, a file is
written) is measured for both: in each round this engine renders one sample there, knowing nothing of the scene, and
the time of the same rays alone is taken off; Cycles restarts in each render, so that its totals are measured, its
rays' time reckoned.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
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
from oracles.cycles import preserved, read_passes, write_multilayer
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.live.sync_cache import clear_syncs
from perfect_bvh_addon.sync.records import AttributeRequest
from tqdm import tqdm

Image = npt.NDArray[np.float32]
Border = tuple[float, float, float, float]  # left, right, bottom, top, as shares of the image
# Samples, seed, border -> image, milliseconds.
Render = Callable[[int, int, Border], tuple[Image, float]]
OPENNESS = 0.3  # the share of the sky that a bounce finds: kOpenness in native/src/render/light/illumination.cpp
WHOLE: Border = (0.0, 1.0, 0.0, 1.0)
MIDDLE: Border = (0.4, 0.6, 0.4, 0.6)  # whole pixels, whatever multiple of 80 the width is
FILTER_WIDTH = 1.5  # of the pixel filter in Cycles: the default, as ours is
REFERENCE_SEED = 1000


def main() -> None:
    """Measure, write the JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--json", type=Path, required=True, metavar="OUT.json", help="where the figures go")
    add("--scene", default="courtyard", help="of blend_scenes")
    add("--size", type=int, default=320, metavar="W", help="of the image, 16:9; a multiple of 80")
    add("--most", type=int, default=64, metavar="N", help="samples a pixel at most")
    add("--seeds", type=int, default=3, metavar="N", help="images of each number of samples")
    add("--converged", type=int, default=4096, metavar="N", help="samples a pixel of what the images are compared with")
    chosen = parser.parse_args()
    perfect_bvh_addon.register()
    bpy.ops.wm.open_mainfile(filepath=str(REPOSITORY / "blend_scenes" / f"{chosen.scene}.blend"))
    scene = bpy.context.scene
    simplify(scene)
    ours = Ours(scene)
    compared = [*renderers(ours, scene, chosen.size)]
    converged: dict[str, Image] = {}
    with tqdm(unit="image") as bar:
        for which in compared:
            bar.set_description(f"converged: {which.integrand}")
            if which.integrand not in converged:
                converged[which.integrand] = middle_of(which.render(chosen.converged, REFERENCE_SEED, MIDDLE)[0])
                bar.update()
        measured = measure(ours, compared, converged, sample_counts(chosen.most), chosen.seeds, bar)
    figures = {
        "scene": chosen.scene,
        "converged_samples": chosen.converged,
        "preview_from_cycles": error(converged["preview"], converged["Cycles"]),
        "starts": len(measured.starts),
        "runs": [row_of(which, measured) for which in compared],
    }
    chosen.json.parent.mkdir(parents=True, exist_ok=True)
    chosen.json.write_text(json.dumps({"machine": describe(), **figures}, indent=1) + "\n", encoding="utf-8")


def simplify(scene: bpy.types.Scene) -> None:
    """One diffuse material, a white sky, no lamps."""
    white = bpy.data.materials.new("Matt")
    white.use_nodes = True
    nodes = white.node_tree.nodes
    nodes.clear()
    diffuse, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (0.8, 0.8, 0.8, 1.0)
    white.node_tree.links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
    scene.view_layers[0].material_override = white
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


@dataclass(frozen=True, slots=True)
class Renderer:
    """name, integrand: those of one integrand converge to one image. width: of its images, in pixels.

    reads_each_time: whether reading the scene and building its trees is part of each render.
    """

    name: str
    integrand: str
    width: int
    render: Render
    reads_each_time: bool = False


def renderers(ours: Ours, scene: bpy.types.Scene, width: int) -> Iterator[Renderer]:
    """The preview, Cycles, clay; and smaller clay with less of its radius, and smaller still."""
    yield Renderer("preview", "preview", width, ours.render("preview", width, smooth=False))
    yield Renderer("preview, smoothed", "preview", width, ours.render("preview", width, smooth=True))
    yield Renderer("Cycles", "Cycles", width, in_cycles(scene, width), reads_each_time=True)
    half = width // 2
    clays = (("clay", width, 1.0), ("clay, half as wide", half, 1.0), ("clay, a quarter as wide", width // 4, 1.0))
    radii = (("clay, 0.25 of the radius", half, 0.25), ("clay, 0.0625 of the radius", half, 0.0625))
    for name, wide, share in (*clays, *radii):
        clay = ours.render("clay", wide, smooth=False, ao_distance=ours.reach * share)
        yield Renderer(name, name, wide, clay)


class Ours:
    """The scene in this engine. reach: the clay's radius of occlusion that it chooses by itself."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        self._scene = scene
        with self._read() as sync:
            # What is kept of it stays as it is while Cycles renders.
            self.snapshot, self.camera, self.appearance = sync.scene.snapshot(), sync.camera, sync.appearance
            places = sync.record.instances.transforms[:, :, 3]
        self.reach = 0.05 * float(np.linalg.norm(np.ptp(places, axis=0)))

    @staticmethod
    def _read() -> closing[SceneSync]:
        sync = SceneSync(attributes=AttributeRequest(material_slots=True, corner_normals=True, shading=True))
        sync.update(bpy.context.evaluated_depsgraph_get())
        return closing(sync)

    def start(self, width: int) -> float:
        """Milliseconds that a render in Blender takes beside its rays, of a scene that nothing is known of."""
        clear_syncs()
        render, chosen = self._scene.render, self._scene.perfect_bvh
        settings = [(chosen, "mode", "PREVIEW"), (chosen, "samples", 1), *in_blender(render, width)]
        with tempfile.TemporaryDirectory() as folder, preserved(*settings):
            started = time.perf_counter()
            write_multilayer(Path(folder) / "image.exr", self._scene, "PERFECT_BVH")
            taken = (time.perf_counter() - started) * 1e3
        return max(0.0, taken - self.render("preview", width, smooth=True)(1, 0, WHOLE)[1])

    def render(self, mode: str, width: int, **options: Any) -> Render:
        def run(samples: int, seed: int, border: Border) -> tuple[Image, float]:
            started = time.perf_counter()
            size, camera = (width, width * 9 // 16), replace(self.camera, border=border)
            keywords = {"appearance": self.appearance, "seed": seed, **options}
            image = perfect_bvh.render(self.snapshot, camera, mode, size, samples, **keywords)
            return image, (time.perf_counter() - started) * 1e3

        return run


def in_blender(render: bpy.types.RenderSettings, width: int) -> list[tuple[Any, str, Any]]:
    """The settings of a renderer in Blender."""
    return [
        (render, "threads_mode", "FIXED"), (render, "threads", perfect_bvh.thread_count()),
        (render, "resolution_x", width), (render, "resolution_y", width * 9 // 16),
        (render, "use_persistent_data", False),
    ]  # fmt: skip


def in_cycles(scene: bpy.types.Scene, width: int) -> Render:
    """The same integrand by Cycles on as many threads."""
    cycles, render, ambient = scene.cycles, scene.render, scene.world.light_settings
    settings = [
        (cycles, "device", "CPU"), (cycles, "use_adaptive_sampling", False), (cycles, "use_denoising", False),
        (cycles, "max_bounces", 1), (cycles, "diffuse_bounces", 1), (cycles, "sample_clamp_indirect", 0.0),
        (cycles, "sample_clamp_direct", 0.0), (cycles, "filter_width", FILTER_WIDTH),
        (cycles, "pixel_filter_type", "BLACKMAN_HARRIS"), *in_blender(render, width),
        (cycles, "use_fast_gi", True), (cycles, "fast_gi_method", "REPLACE"), (cycles, "ao_bounces_render", 2),
        (ambient, "ao_factor", OPENNESS), (ambient, "distance", 1e-4),
        (render, "use_border", True), (render, "use_crop_to_border", False),
    ]  # fmt: skip

    def run(samples: int, seed: int, border: Border) -> tuple[Image, float]:
        names = ("border_min_x", "border_max_x", "border_min_y", "border_max_y")
        places = [(render, name, value) for name, value in zip(names, border, strict=True)]
        with (
            tempfile.TemporaryDirectory() as folder,
            preserved(*settings, *places, (cycles, "samples", samples), (cycles, "seed", seed)),
        ):
            path = Path(folder) / "image.exr"
            started = time.perf_counter()
            write_multilayer(path, scene, "CYCLES")
            taken = (time.perf_counter() - started) * 1e3
            return read_passes(path, scene.view_layers[0].name).combined, taken

    return run


def sample_counts(most: int) -> list[int]:
    """1, 4, 16 ... up to `most`."""
    return [4**power for power in range(most.bit_length()) if 4**power <= most]


@dataclass(slots=True)
class Measured:
    """starts: milliseconds that a render in Blender takes beside its rays.

    errors, times in milliseconds: by a renderer's name and a number of samples, one for each seed.
    """

    starts: list[float]
    errors: dict[tuple[str, int], list[float]]
    times: dict[tuple[str, int], list[float]]


def measure(
    ours: Ours,
    compared: list[Renderer],
    converged: dict[str, Image],
    counts: list[int],
    seeds: int,
    bar: tqdm[Any],
) -> Measured:
    """Whole images of all renderers by turns; before each round ours restarts in Blender."""
    measured = Measured([], defaultdict(list), defaultdict(list))
    for samples in counts:
        bar.set_description(f"{samples} samples")
        for seed in range(seeds):
            measured.starts.append(ours.start(compared[0].width))
            for turn in range(len(compared)):
                which = compared[(turn + seed) % len(compared)]
                image, taken = which.render(samples, seed, WHOLE)
                measured.errors[which.name, samples].append(error(middle_of(image), converged[which.integrand]))
                measured.times[which.name, samples].append(taken)
                bar.update()
    return measured


def row_of(which: Renderer, measured: Measured) -> dict[str, Any]:
    """What the figures hold of a renderer. total_ms: with reading the scene and all; ms: of the rays alone."""
    times = {samples: values for (name, samples), values in measured.times.items() if name == which.name}
    start = Spread.of(_starts_of(times) if which.reads_each_time else measured.starts)
    points = []
    for samples, taken in times.items():
        ms = [max(value - start.median, 0.0) for value in taken] if which.reads_each_time else taken
        points.append(
            {
                "samples": samples,
                "error": Spread.of(measured.errors[which.name, samples]).as_json(),
                "ms": Spread.of(ms).as_json(),
                "total_ms": (Spread.of(taken) if which.reads_each_time else _sum(Spread.of(taken), start)).as_json(),
            }
        )
    return {
        "name": which.name,
        "width": which.width,
        "sync_ms": start.as_json(),
        "reads_each_time": which.reads_each_time,
        "points": points,
    }


def _starts_of(times: dict[int, list[float]]) -> list[float]:
    """Of a renderer that reads the scene in each render: what of the time does not grow with the samples, by seeds."""
    few, many = min(times), max(times)
    pairs = zip(times[few], times[many], strict=True)
    return [max(0.0, first - few * (last - first) / max(1, many - few)) for first, last in pairs]


def _sum(one: Spread, other: Spread) -> Spread:
    """Of two that were measured apart; its quartiles are the widest that their sum may have."""
    return Spread(one.median + other.median, one.low + other.low, one.high + other.high)


def middle_of(image: Image) -> Image:
    """The part of it that is compared."""
    height, width = image.shape[:2]
    left, right, bottom, top = MIDDLE
    return image[
        round((1.0 - top) * height) : round((1.0 - bottom) * height), round(left * width) : round(right * width)
    ]


def error(image: Image, reference: Image) -> float:
    """Root of the mean square difference of the colours, as a share of the reference's mean."""
    wanted = reference[..., :3].astype(np.float64)
    return float(np.sqrt(np.mean((image[..., :3] - wanted) ** 2)) / wanted.mean())


if __name__ == "__main__":
    main()
