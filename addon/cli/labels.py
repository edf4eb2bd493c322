"""`perfect-bvh labels`: exact labels of frames of a file, each in separate files, and one file for all masks."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from .arguments import CommandError, check_blend_file, check_pieces, parse_folder
from .blender import StopRequest, active_view_layer, apply_settings, open_scene, stop_on_interrupt
from .frames import run_pieces
from .report import quiet_blender

if TYPE_CHECKING:
    import bpy

    from ..pieces.work import PieceWork

# What labels depend on, among the arguments.
CHOICES = ("size", "category", "labels", "layers", "flow", "viewport", "format", "depth_scale", "no_coco")


def run_labels(arguments: argparse.Namespace) -> int:
    """Label as the arguments say; returns the exit status."""
    check_pieces(arguments)
    path = check_blend_file(arguments.file)
    _check_formats(arguments)
    folder = parse_folder(arguments.output)
    arguments.file, arguments.output = str(path), str(folder)  # as workers, which are elsewhere, find them
    with quiet_blender() as out, stop_on_interrupt() as stop:
        return run_pieces(labels_work, open_scene(path, arguments), stop, arguments, out)


def _check_formats(arguments: argparse.Namespace) -> None:
    from ..labels import bop
    from ..labels.files import DEPTH_SCALE, FORMATS, check_formats

    try:
        check_formats([name for name in arguments.format if name != bop.FORMAT], arguments.labels)
        arguments.format = [name for name in (*FORMATS, bop.FORMAT) if name in arguments.format]  # in any order
    except (ValueError, ImportError) as error:
        raise CommandError(f"--format: {error}") from error
    if arguments.depth_scale is not None and not {"png", bop.FORMAT} & set(arguments.format):
        raise CommandError("--depth-scale applies to PNG files: add png or bop to --format, or omit it")
    if arguments.depth_scale is None:
        arguments.depth_scale = DEPTH_SCALE


def labels_work(scene: bpy.types.Scene, _stop: StopRequest, arguments: argparse.Namespace) -> PieceWork:
    """Returns the chunks of labelled frames: the files of each frame, and its data for the file of COCO's format."""
    from ..datasets.bop_work import BopWork
    from ..extract.scene_in_time import has_simulations
    from ..labels.bop import FORMAT
    from ..labels.piece_labels import BEFORE, WHAT, LabelPlan, LabelWork
    from ..live.scene_view import SceneView
    from ..pieces.piece import PieceFolder, scene_inputs

    plan = LabelPlan(
        frames=arguments.frames or (scene.frame_current,),
        formats=tuple(name for name in arguments.format if name != FORMAT),
        layers=arguments.layers,
        category=arguments.category,
        labels=tuple(arguments.labels),
        flow=arguments.flow,
        depth_scale=arguments.depth_scale,
        has_coco=not arguments.no_coco,
        has_bop=FORMAT in arguments.format,
        piece=arguments.piece,
        threads=arguments.threads or 0,
    )
    begins = min(plan.frames) if has_simulations(scene) else None
    inputs = scene_inputs(arguments, *CHOICES, begins=begins)
    apply_settings(scene, arguments)
    view = SceneView("labels", scene, active_view_layer(scene), for_viewport=arguments.viewport)
    return (BopWork if plan.has_bop else LabelWork)(
        view, plan, PieceFolder(Path(arguments.output), inputs, BEFORE, WHAT)
    )
