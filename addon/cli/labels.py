"""`perfect-bvh labels`: exact labels of frames of a file, an .npz a frame and one file for all masks."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from . import EXIT_INTERRUPTED
from .arguments import CommandError, check_blend_file, parse_folder
from .blender import StopRequest, apply_settings, go_to_frame, open_scene, render_job, stop_on_interrupt
from .console import quiet_blender

if TYPE_CHECKING:
    import bpy

    from ..labels import CocoFile, Labels
    from ..live.scene_sync import SceneSync


def run_labels(arguments: argparse.Namespace) -> int:
    """Label what the arguments say; the exit status."""
    path = check_blend_file(arguments.file)
    folder = parse_folder(arguments.output)
    coco = None if arguments.no_coco else _coco_file()
    with quiet_blender() as out, stop_on_interrupt() as stop:
        scene = open_scene(path, arguments)
        if scene.camera is None:
            raise CommandError(f"{arguments.file}: scene {scene.name!r} has no camera")
        apply_settings(scene, arguments)
        frames = arguments.frames or (scene.frame_current,)
        started = time.perf_counter()
        done = _label_all(scene, frames, folder, coco, stop, arguments)
        if coco is not None and done:
            _save(coco.save, folder / f"coco_{min(frames[:done]):04d}-{max(frames[:done]):04d}.json")
        if not arguments.quiet:
            seconds = time.perf_counter() - started
            out.write(f"{folder}: {done} of {len(frames)} frames in {seconds:.2f} s\n")
    if done < len(frames):
        sys.stderr.write(f"perfect-bvh: stopped; {done} of {len(frames)} frames are written\n")
        return EXIT_INTERRUPTED
    return 0


def _coco_file() -> CocoFile:
    from ..labels import CocoFile

    try:
        return CocoFile()
    except ImportError as error:
        raise CommandError(f"{error}; or leave it out: --no-coco") from error


def _label_all(
    scene: bpy.types.Scene,
    frames: tuple[int, ...],
    folder: Path,
    coco: CocoFile | None,
    stop: StopRequest,
    arguments: argparse.Namespace,
) -> int:
    """How many frames are written."""
    from tqdm import tqdm

    from ..live.scene_sync import SceneSync

    sync, warned = SceneSync(watch=False), set[str]()
    # None: shown on a terminal only, so that logs stay clean.
    is_disabled = True if arguments.quiet else None
    with tqdm(total=len(frames), unit="frame", disable=is_disabled, leave=False, file=sys.stderr) as bar:
        for number, frame in enumerate(frames):
            labels = None if stop.is_set else _label(scene, frame, sync, stop, arguments)
            if labels is None:
                return number
            _save(labels.save, folder / f"labels_{frame:04d}.npz")
            if coco is not None:
                coco.add(labels, f"frame_{frame:04d}.png")
            for warning in labels.warnings:
                if warning not in warned:
                    warned.add(warning)
                    tqdm.write(f"perfect-bvh: {warning}", file=sys.stderr)
            bar.update()
    return len(frames)


def _label(
    scene: bpy.types.Scene, frame: int, sync: SceneSync, stop: StopRequest, arguments: argparse.Namespace
) -> Labels | None:
    """Of one frame, as it would be rendered; None if it was stopped."""
    import perfect_bvh

    from ..engine import RenderJob
    from ..labels import label_image

    made: list[Labels] = []
    faults: list[ValueError] = []

    def visit(depsgraph: bpy.types.Depsgraph, frame_set: Callable[[int, float], None]) -> None:
        try:
            labels = label_image(
                depsgraph,
                sync=sync,
                layers=arguments.layers,
                category=arguments.category,
                flow=arguments.flow,
                frame_set=frame_set,
                threads=arguments.threads or 0,
                progress=lambda _: not stop.is_set,
            )
        except perfect_bvh.Cancelled:
            return
        except ValueError as error:
            faults.append(error)
            return
        made.append(labels)

    go_to_frame(scene, frame)
    render_job(scene, RenderJob(visit=visit))
    if faults:
        raise CommandError(f"frame {frame}: {faults[0]}") from faults[0]
    return made[0] if made else None


def _save(save: Callable[[Path], Path], path: Path) -> None:
    try:
        save(path)
    except OSError as error:
        raise CommandError(error.strerror or str(error)) from error
