"""`perfect-bvh scan`: what a sensor measures over the frames of a file, in pieces that a second run recognises."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from .arguments import CommandError, check_blend_file, check_pieces, parse_folder
from .blender import StopRequest, go_to_frame, open_scene, stop_on_interrupt
from .console import quiet_blender
from .piece_work import Advance, Done, PieceWork, explained, run_pieces

if TYPE_CHECKING:
    import bpy

    from ..pieces.piece import Piece
    from ..scanning.sensor_files import Sensor


def run_scan(arguments: argparse.Namespace) -> int:
    """Scan what the arguments say; the exit status."""
    from ..scanning.outcomes import RayCounts

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
    folder = parse_folder(arguments.output)
    arguments.file, arguments.output = str(path), str(folder)  # as workers, which are elsewhere, find them
    with quiet_blender() as out, stop_on_interrupt() as stop:
        scene = open_scene(path, arguments)
        started = time.perf_counter()
        work = ScanWork(scene, stop, arguments)
        outcome, status = run_pieces(work, out)
        if not arguments.quiet:
            seconds = time.perf_counter() - started
            recognised = f", {outcome.kept} were there" if outcome.kept else ""
            points = outcome.counts.pop("points", 0)
            pieces = f"{outcome.written} of {len(work.pieces)} pieces"
            out.write(f"{folder}: {pieces}{recognised}; {points:,} points in {seconds:.2f} s\n")
            if outcome.written:
                out.write(f"{RayCounts(**outcome.counts)}\n")
    return status


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


class ScanWork(PieceWork):
    """The pieces of a scan."""

    def __init__(self, scene: bpy.types.Scene, stop: StopRequest, arguments: argparse.Namespace) -> None:
        from ..scanning.piece_scan import ScanPlan

        super().__init__(scene, stop, arguments)
        self._carrier = _carrier(scene, arguments.on)
        self._plan = ScanPlan(
            sensor=_sensor(arguments.sensor),
            frames=self.frames,
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
        self.pieces = self._plan.pieces()
        how = {"autoexec": arguments.autoexec, "allow_missing": arguments.allow_missing}
        inputs = self._plan.inputs(Path(arguments.file), self._carrier, **how)
        self.place = self._plan.folder(Path(arguments.output), inputs)

    def make(self, piece: Piece, advance: Advance) -> Done | None:
        """By a scene of the engine's own: what a piece holds, ids of instances included, depends on no piece before."""
        from ..scanning.pieces import write_piece

        go_to_frame(self.scene, piece.first, self.is_simulated or self.arguments.viewport)
        try:
            scanner = self._plan.scanner(piece, self._carrier)
            if not scanner.run(advance):
                return None
        except ValueError as error:
            raise CommandError(f"{piece}: {error}") from error
        except ReferenceError as error:
            raise CommandError(f"{piece}: the object that carries the sensor is not there any more") from error
        cloud = scanner.result()
        with explained():
            write_piece(self.place, piece, cloud)
        return Done({"points": len(cloud), **cloud.ray_outcomes.named}, cloud.warnings)

    def join(self) -> None:
        """Nothing: points of all pieces are put together by who reads them."""
