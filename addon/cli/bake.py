"""`perfect-bvh bake`: values of faces by rays that leave them, as a table for each frame."""

from __future__ import annotations

import argparse
import math
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .arguments import CommandError, check_blend_file, check_pieces, parse_folder
from .blender import StopRequest, active_view_layer, apply_settings, open_scene, stop_on_interrupt
from .commands import check_format
from .frames import run_pieces
from .report import quiet_blender

if TYPE_CHECKING:
    import bpy

    from ..baking import DirectionTable
    from ..pieces.work import PieceWork

# What tables depend on, among the arguments.
CHOICES = (
    *("kind", "domain", "objects", "rays", "seed", "distance", "falloff", "method", "angle", "cosine", "viewer"),
    *("place", "zone", "north", "days", "minutes", "instances", "viewport", "format"),
)


def run_bake(arguments: argparse.Namespace) -> int:
    """Bake as the arguments say; returns the exit status."""
    check_pieces(arguments)
    path = check_blend_file(arguments.file)
    if arguments.kind == "sun-hours" and (arguments.epw is None) == (arguments.place is None):
        raise CommandError("--kind sun-hours needs --place and --days, or a weather file: --epw")
    if arguments.place and not arguments.days:
        raise CommandError("--place needs --days, such as 2026-03-21")
    if arguments.days and len(arguments.days) > 2:
        raise CommandError(f"--days takes the first and the last day, got {len(arguments.days)} days")
    check_format(f".{arguments.format}", [])
    if arguments.epw:
        arguments.epw = str(Path(arguments.epw).absolute())
    arguments.file, arguments.output = str(path), str(parse_folder(arguments.output))  # as workers find them
    with quiet_blender() as out, stop_on_interrupt() as stop:
        return run_pieces(bake_work, open_scene(path, arguments), stop, arguments, out)


def bake_work(scene: bpy.types.Scene, _stop: StopRequest, arguments: argparse.Namespace) -> PieceWork:
    """Returns the chunks of baked frames. Errors: CommandError."""
    from ..baking import BakeSettings
    from ..baking.piece_bake import BEFORE, BakeWork
    from ..extract.scene_in_time import has_simulations
    from ..live.scene_view import SceneView
    from ..pieces.piece import PieceFolder, inputs_of, scene_inputs

    frames = arguments.frames or (scene.frame_current,)
    viewer = None if arguments.viewer is None else scene.objects.get(arguments.viewer)
    if arguments.viewer is not None and viewer is None:
        raise CommandError(f"--viewer: scene {scene.name!r} has no object {arguments.viewer!r}")
    choices: dict[str, Any] = {name: getattr(arguments, name) for name in ("rays", "seed", "falloff", "instances")}
    choices |= {"distance": arguments.distance or math.inf, "angle": math.radians(arguments.angle)}
    choices |= {"cosine": arguments.cosine, "method": arguments.method.upper(), "viewers": viewer, "evaluated": True}
    kind, suffix = arguments.kind.replace("-", "_").upper(), f".{arguments.format}"
    try:
        table = _table(arguments) if kind == "SUN_HOURS" else None
        settings = BakeSettings(kind, arguments.domain.upper(), directions=table, **choices)
    except ValueError as error:
        raise CommandError(str(error)) from error
    except OSError as error:
        raise CommandError(f"--epw {arguments.epw}: {error.strerror or error}") from error
    begins = min(frames) if has_simulations(scene) else None
    weather = {} if arguments.epw is None else inputs_of([Path(arguments.epw)])["files"]
    inputs = scene_inputs(arguments, *CHOICES, begins=begins, weather=weather)
    apply_settings(scene, arguments)
    view = SceneView("bake", scene, active_view_layer(scene), for_viewport=arguments.viewport)
    place = PieceFolder(Path(arguments.output), inputs, BEFORE, "bake")
    how = {"size": arguments.piece, "threads": arguments.threads or 0, "warnings": table.warnings if table else ()}
    return BakeWork(view, settings, frames, arguments.objects, place, suffix, **how)


def _table(arguments: argparse.Namespace) -> DirectionTable:
    """The directions of the sun. Raises ValueError, and OSError for a weather file."""
    from ..baking.sun import Place, irradiance_table, read_epw, sun_table

    days = [date.fromisoformat(day) for day in arguments.days or ()]
    if arguments.epw is not None:
        first, last = (days[0], days[-1]) if days else (None, None)
        return irradiance_table(read_epw(Path(arguments.epw), north=arguments.north), first, last)
    place = Place(*arguments.place, arguments.zone, arguments.north)
    return sun_table(place, days[0], days[-1], step=arguments.minutes)
