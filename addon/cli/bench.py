"""`perfect-bvh bench`: what builders and policies cost and gain on a scene, as a table and charts."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from .arguments import EXIT_INTERRUPTED, CommandError, check_blend_file, parse_folder
from .blender import StopRequest, active_view_layer, open_scene, stop_on_interrupt
from .console import quiet_blender

if TYPE_CHECKING:
    import bpy


def run_bench(arguments: argparse.Namespace) -> int:
    """Measure, write the files and print the advice; the exit status, 130 if it was stopped and wrote what it had."""
    path = check_blend_file(arguments.file)
    folder = parse_folder(arguments.output)
    with quiet_blender() as out, stop_on_interrupt() as stop:
        scene = open_scene(path, arguments)
        return _measure(scene, folder, arguments, stop, out)


def _measure(
    scene: bpy.types.Scene, folder: Path, arguments: argparse.Namespace, stop: StopRequest, out: TextIO
) -> int:
    import perfect_bvh
    from tqdm import tqdm

    from ..bench.from_blender import subject_of
    from ..bench.measurements import SceneBench
    from ..bench.results import HOW_TO_GET_CHARTS, write
    from ..bench.table import format_table
    from ..live.scene_view import SceneView, go_to_frame

    if arguments.threads is not None:
        perfect_bvh.set_thread_count(min(arguments.threads, 1024))
    go_to_frame(scene, scene.frame_current, arguments.viewport)
    view = SceneView("bench", scene, active_view_layer(scene), for_viewport=arguments.viewport)
    bench = SceneBench(subject_of(scene, for_viewport=arguments.viewport), arguments.seconds)
    bar_format = "{l_bar}{bar}| {elapsed}"

    def run() -> None:
        for share, what in bench.steps():
            bar.set_description(what)
            bar.update(share - bar.n)
            if stop.is_set:
                break

    with tqdm(total=1.0, bar_format=bar_format, disable=None, leave=False, file=sys.stderr) as bar:
        try:
            view.hold(run)
        except ValueError as error:
            raise CommandError(str(error)) from error
    try:
        results = write(bench.figures, folder)
    except OSError as error:
        raise CommandError(f"cannot write into {folder}: {error.strerror}") from error
    out.write(f"{format_table(results.table)}\n")
    for name, sentence in results.advice.items():
        out.write(f"{results.pictures[name].name if name in results.pictures else name}: {sentence}\n")
    if not results.can_draw:
        out.write(f"{HOW_TO_GET_CHARTS}\n")
    out.write(f"{results.json}\n")
    if stop.is_set:
        sys.stderr.write("perfect-bvh: stopped; what had been measured is written\n")
        return EXIT_INTERRUPTED
    return 0
