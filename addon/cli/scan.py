"""`perfect-bvh scan`: what a sensor measures over the frames of a file, in pieces that a second run recognises."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from .arguments import CommandError, check_blend_file, check_pieces, parse_folder
from .blender import StopRequest, open_scene, stop_on_interrupt
from .console import quiet_blender
from .piece_work import run_pieces

if TYPE_CHECKING:
    import bpy

    from ..pieces.work import PieceWork
    from ..scanning.sensor_files import Sensor


def run_scan(arguments: argparse.Namespace) -> int:
    """Scan what the arguments say; the exit status."""
    if arguments.list_sensors:
        _list_sensors()
        return 0
    for name in ("file", "output"):
        if getattr(arguments, name) is None:
            raise CommandError(f"expected {'FILE.blend' if name == 'file' else '-o DIR'}; see perfect-bvh scan --help")
    check_pieces(arguments)
    if arguments.steps is not None and arguments.frames is None:
        raise CommandError("--steps needs --frames: one whole pass in the current frame has no further key moments")
    path = check_blend_file(arguments.file)
    _check_format(f".{arguments.format}", arguments.labels)
    arguments.sensor = _sensor_name(arguments.sensor)
    arguments.file, arguments.output = (
        str(path),
        str(parse_folder(arguments.output)),
    )  # as workers, which are elsewhere, find them
    with quiet_blender() as out, stop_on_interrupt() as stop:
        return run_pieces(scan_work, open_scene(path, arguments), stop, arguments, out)


def scan_work(scene: bpy.types.Scene, _stop: StopRequest, arguments: argparse.Namespace) -> PieceWork:
    """The pieces of a scan."""
    from ..scanning.piece_scan import ScanPlan, ScanWork

    plan = ScanPlan(
        sensor=_sensor(arguments.sensor),
        frames=arguments.frames or (scene.frame_current,),
        is_one_pass=arguments.frames is None,
        suffix=f".{arguments.format}",
        size=arguments.piece,
        steps=arguments.steps or 1,
        threads=arguments.threads or 0,
        seed=arguments.seed,
        labels=tuple(arguments.labels),
        exclude_mount=arguments.exclude_mount,
        for_viewport=arguments.viewport,
    )
    carrier = _carrier(scene, arguments.on)
    how = {"autoexec": arguments.autoexec, "allow_missing": arguments.allow_missing}
    inputs = plan.inputs(Path(arguments.file), carrier, **how)
    return ScanWork(plan, carrier, plan.folder(Path(arguments.output), inputs))


def _list_sensors() -> None:
    from ..scanning.sensor_files import load_sensor, sensor_names

    width = max(map(len, sensor_names()))
    for name in sensor_names():
        sys.stdout.write(f"{name:<{width}}  {load_sensor(name).title}\n")


def _sensor_name(name: str) -> str:
    """What is known by it wherever a worker is: a sensor's own file by its whole path. Errors: CommandError."""
    _sensor(name)
    return str(Path(name).absolute()) if name.lower().endswith(".toml") else name


def _sensor(name: str) -> Sensor:
    from ..scanning.sensor_files import load_sensor

    try:
        return load_sensor(name)
    except OSError as error:
        raise CommandError(f"--sensor {name}: {error.strerror or error}") from error
    except ValueError as error:
        raise CommandError(f"--sensor {name}: {str(error).removeprefix('sensor: ')}") from error


def _check_format(suffix: str, labels: list[str]) -> None:
    from ..scanning.formats import check_format

    try:
        check_format(suffix, labels)
    except (ValueError, ImportError) as error:
        raise CommandError(f"--format: {error}") from error


def _carrier(scene: bpy.types.Scene, name: str | None) -> bpy.types.Object | None:
    """The object that carries the sensor; None for the camera of each frame."""
    import difflib

    if name is None:
        return None
    found = scene.objects.get(name)
    if found is None:
        near = difflib.get_close_matches(name, scene.objects.keys(), n=1, cutoff=0.5)
        hint = f" (is it {near[0]!r}?)" if near else ""
        raise CommandError(f"--on {name}: scene {scene.name!r} has no such object{hint}")
    return found
