"""The time to the first full image of a scene not seen before: ours and Cycles', raw and denoised.

    python tests/benchmarks/first_image.py --json first_image.json

One sample a pixel, by the scene's own light paths; each engine denoises as its own settings do by default. All take
turns in one process. The clock runs from when Blender has evaluated the scene and calls the engine until the engine has
returned the image (`engine`), in wall-clock seconds and in CPU seconds of all threads; the rest of the whole request is
Blender's own part, the same for both (`blender`). For ours the time is split up: reading Blender's scene, building
trees, tracing, denoising, the rest, and saving as a PNG, which Cycles' request does not include either.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import bpy
import perfect_bvh_addon
from benchmarks.image_error import RENDERERS, SCENES, Renderer, settings_of
from benchmarks.machine import describe
from benchmarks.rounds import Spread
from benchmarks.rows import write_rows
from benchmarks.tables import format_table
from oracles.cycles import preserved
from perfect_bvh_addon.engine import PerfectBVHRenderEngine, RenderJob, attend
from perfect_bvh_addon.image.saving import save_image
from perfect_bvh_addon.image.still import Frame
from perfect_bvh_addon.live.sync_cache import clear_syncs
from perfect_bvh_addon.settings.modes import find_mode

PARTS = ("read", "build", "trace", "denoise", "rest", "save")
# Ours, and the images of Cycles that it is compared with.
PAIRS = {"raw": ("ours", "Cycles"), "denoised": ("ours, denoised", "Cycles, denoised")}
Figures = dict[str, float]


@dataclass(slots=True)
class EngineClock:
    """From the first call of an engine during a render to the end of the last one. In seconds, -1 before."""

    began: float = -1.0
    ended: float = -1.0
    began_cpu: float = -1.0
    ended_cpu: float = -1.0

    def time(self, call: Callable[[], None]) -> None:
        """One of the calls."""
        if self.began < 0.0:
            self.began, self.began_cpu = time.perf_counter(), time.process_time()
        try:
            call()
        finally:
            self.ended, self.ended_cpu = time.perf_counter(), time.process_time()


@contextmanager
def timed_engines() -> Iterator[EngineClock]:
    """Within the context both engines report to the clock."""
    import cycles

    clock = EngineClock()
    theirs, ours = cycles.CyclesRender, PerfectBVHRenderEngine
    update, render, our_render = theirs.update, theirs.render, ours.render

    # Blender counts their arguments.
    def timed_update(self: Any, data: Any, depsgraph: Any) -> None:
        clock.time(lambda: update(self, data, depsgraph))

    def timed_render(self: Any, depsgraph: Any) -> None:
        clock.time(lambda: render(self, depsgraph))

    def timed_our_render(self: Any, depsgraph: Any) -> None:
        clock.time(lambda: our_render(self, depsgraph))

    theirs.update, theirs.render, ours.render = timed_update, timed_render, timed_our_render
    try:
        yield clock
    finally:
        theirs.update, theirs.render, ours.render = update, render, our_render


def main() -> None:
    """Measure, write the JSON, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--json", type=Path, required=True, metavar="OUT.json", help="where the figures go")
    add("--scenes", nargs="+", default=["courtyard"], help="of blend_scenes")
    add("--size", type=int, default=960, metavar="W", help="of the images, 16:9")
    add("--rounds", type=int, default=5, metavar="N", help="images of each kind; the first ones are told apart")
    chosen = parser.parse_args()
    perfect_bvh_addon.register()
    scenes = [measure(name, chosen.size, chosen.rounds) for name in chosen.scenes]
    figures = {"machine": describe(), "width": chosen.size, "rounds": chosen.rounds, "scenes": scenes}
    write_rows(chosen.json, figures)
    print("\n\n".join(map(table_of, scenes)))


def measure(name: str, width: int, rounds: int) -> dict[str, Any]:
    """One scene: the figures of each renderer. Its first image, where much is set up, counts only if it is all."""
    bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{name}.blend"))
    scene = bpy.context.scene
    taken: dict[str, list[Figures]] = {which.name: [] for which in RENDERERS}
    for number in range(rounds):
        for turn in range(len(RENDERERS)):
            which = RENDERERS[(turn + number) % len(RENDERERS)]
            taken[which.name].append(render(scene, which, width, seed=number))
    runs = {which: figures_of(figures) for which, figures in taken.items()}
    return {
        "name": name,
        "runs": [{"name": which, **figures} for which, figures in runs.items()],
        "share_of_cycles": {
            pair: {key: runs[ours][key]["median"] / runs[theirs][key]["median"] for key in ("engine", "engine_cpu")}
            for pair, (ours, theirs) in PAIRS.items()
        },
    }


def figures_of(taken: list[Figures]) -> dict[str, Any]:
    """Spreads over the later rounds, and the first one."""
    later = taken[1:] or taken
    return {"first": taken[0]} | {key: Spread.of([each[key] for each in later]).as_json() for key in taken[0]}


def render(scene: bpy.types.Scene, which: Renderer, width: int, seed: int) -> Figures:
    """Seconds of one image, with nothing kept from before."""
    clear_syncs()
    job = RenderJob()
    with preserved(*settings_of(scene, which, width, 1, seed)), timed_engines() as clock, attend(job):
        started = time.perf_counter()
        bpy.ops.render.render()
        whole = time.perf_counter() - started
        engine = clock.ended - clock.began
        figures = {"engine": engine, "engine_cpu": clock.ended_cpu - clock.began_cpu, "blender": whole - engine}
        if job.frame is not None:
            figures |= parts_of(job.frame, engine) | {"save": time_saving(job.frame, scene)}
    return figures


def parts_of(frame: Frame, engine: float) -> Figures:
    """Seconds of our engine's stages, by its own statistics."""
    statistics = frame.statistics
    report = statistics.report
    parts = {
        "read": report.read_milliseconds + report.compare_milliseconds + report.apply_milliseconds,
        "build": report.commit_milliseconds,
        "trace": statistics.trace_milliseconds,
        "denoise": statistics.denoise_milliseconds,
    }
    seconds = {name: milliseconds * 1e-3 for name, milliseconds in parts.items()}
    return seconds | {"rest": engine - sum(seconds.values())}


def time_saving(frame: Frame, scene: bpy.types.Scene) -> float:
    """Seconds to the file that `perfect-bvh render` writes."""
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        save_image(Path(folder) / "image.png", frame.cut(frame.images["combined"]), scene, find_mode("preview"))
        return time.perf_counter() - started


def table_of(scene: dict[str, Any]) -> str:
    """One scene for the console, in milliseconds."""
    keys = ("engine", "engine_cpu", "blender", *PARTS)
    rows = [[run["name"], *(run[key]["median"] * 1e3 if key in run else None for key in keys)] for run in scene["runs"]]
    lines = [format_table([f"{scene['name']}, ms", *keys], rows)]
    for pair, share in scene["share_of_cycles"].items():
        lines.append(f"{pair}: {share['engine']:.2f} of Cycles' time, {share['engine_cpu']:.2f} of its CPU time")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
