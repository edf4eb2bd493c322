"""`perfect-bvh scan`: what a sensor measures over the frames of a file, in pieces that a second run recognises."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from . import EXIT_INTERRUPTED
from .arguments import CommandError, check_blend_file, parse_folder
from .blender import StopRequest, open_scene, stop_on_interrupt
from .console import quiet_blender

if TYPE_CHECKING:
    import bpy

    from ..scanning.pieces import Piece, PieceFolder
    from ..scanning.point_cloud import PointCloud
    from ..scanning.sensor_files import Sensor


def run_scan(arguments: argparse.Namespace) -> int:
    """Scan what the arguments say; the exit status."""
    if arguments.list_sensors:
        _list_sensors()
        return 0
    for name in ("file", "output"):
        if getattr(arguments, name) is None:
            raise CommandError(f"expected {'FILE.blend' if name == 'file' else '-o DIR'}; see perfect-bvh scan --help")
    path = check_blend_file(arguments.file)
    sensor, suffix = _sensor(arguments.sensor), f".{arguments.format}"
    _check_format(suffix)
    folder = parse_folder(arguments.output)
    with quiet_blender() as out, stop_on_interrupt() as stop:
        scene = open_scene(path, arguments)
        carrier = _carrier(scene, arguments.on)
        started = time.perf_counter()
        session = ScanSession(scene, carrier, sensor, stop, arguments)
        pieces, written, kept, points = session.run(path, folder, suffix)
        if not arguments.quiet:
            seconds = time.perf_counter() - started
            recognised = f", {kept} were there" if kept else ""
            out.write(f"{folder}: {written} of {pieces} pieces{recognised}; {points:,} points in {seconds:.2f} s\n")
    if written + kept < pieces:
        sys.stderr.write("perfect-bvh: stopped; --resume goes on\n")
        return EXIT_INTERRUPTED
    return 0


def _list_sensors() -> None:
    from ..scanning.sensor_files import load_sensor, sensor_names

    width = max(map(len, sensor_names()))
    for name in sensor_names():
        sys.stdout.write(f"{name:<{width}}  {load_sensor(name).title}\n")


def _sensor(name: str) -> Sensor:
    from ..scanning.sensor_files import load_sensor

    try:
        return load_sensor(name)
    except OSError as error:
        raise CommandError(f"--sensor {name}: {error.strerror or error}") from error
    except ValueError as error:
        raise CommandError(f"--sensor {name}: {str(error).removeprefix('sensor: ')}") from error


def _check_format(suffix: str) -> None:
    from ..scanning.formats import check_format

    try:
        check_format(suffix)
    except (ValueError, ImportError) as error:
        raise CommandError(f"--format: {error}") from error


def _carrier(scene: bpy.types.Scene, name: str | None) -> bpy.types.Object:
    """The object that carries the sensor."""
    import difflib

    if name is None:
        if scene.camera is None:
            raise CommandError(f"scene {scene.name!r} has no camera that could carry the sensor; name an object: --on")
        return scene.camera
    found = scene.objects.get(name)
    if found is None:
        near = difflib.get_close_matches(name, scene.objects.keys(), n=1, cutoff=0.5)
        hint = f" (is it {near[0]!r}?)" if near else ""
        raise CommandError(f"--on {name}: scene {scene.name!r} has no such object{hint}")
    return found


class ScanSession:
    """One run over the pieces of a scan."""

    def __init__(
        self,
        scene: bpy.types.Scene,
        carrier: bpy.types.Object,
        sensor: Sensor,
        stop: StopRequest,
        arguments: argparse.Namespace,
    ) -> None:
        self._scene = scene
        self._carrier = carrier
        self._sensor = sensor
        self._stop = stop
        self._arguments = arguments
        self._frames: tuple[int, ...] = arguments.frames or (scene.frame_current,)
        self._played_to = min(self._frames) - 1
        self._warned: set[str] = set()

    def run(self, path: Path, folder: Path, suffix: str) -> tuple[int, int, int, int]:
        """How many pieces there are, were written and were there before, and how many points were written."""
        from tqdm import tqdm

        from ..scanning.pieces import OtherInputsError, PieceFolder, pieces_of

        arguments = self._arguments
        pieces = pieces_of(self._frames, arguments.piece)
        place = PieceFolder(folder, self._inputs(path, suffix), suffix)
        try:
            place.check(pieces)
        except OtherInputsError as error:
            raise CommandError(f"-o: {error}") from error
        written = kept = points = 0
        # None: shown on a terminal only, so that logs stay clean.
        is_disabled = True if arguments.quiet else None
        with tqdm(total=len(pieces), unit="piece", disable=is_disabled, leave=False, file=sys.stderr) as bar:
            for number, piece in enumerate(pieces):
                if arguments.resume and place.is_done(piece):
                    kept += 1
                    bar.update(number + 1 - bar.n)
                    continue
                cloud = None if self._stop.is_set else self._scan(piece, number, bar)
                if cloud is None:
                    break
                self._played_to = piece.frames[1]
                self._write(place, piece, cloud)
                written, points = written + 1, points + len(cloud)
                bar.update(number + 1 - bar.n)
        return len(pieces), written, kept, points

    def _inputs(self, path: Path, suffix: str) -> dict[str, object]:
        import bpy
        import perfect_bvh

        from ..scanning.pieces import inputs_of

        arguments = self._arguments
        read = [Path(name) for name in bpy.utils.blend_paths(absolute=True)]
        return inputs_of(
            [path, *read],
            self._sensor.pattern,
            on=self._carrier.name,
            steps=arguments.steps,
            begins=min(self._frames),
            is_one_pass=arguments.frames is None,
            format=suffix,
            autoexec=arguments.autoexec,
            allow_missing=arguments.allow_missing,
            blender=bpy.app.version_string,
            version=perfect_bvh.__version__,
        )

    def _play_to(self, frame: int) -> None:
        """Through the frames of pieces that were there, if anything is simulated: it depends on those before it."""
        from ..extract.simulations import has_simulations

        if has_simulations(self._scene):
            for number in sorted(set(self._frames)):
                if self._played_to < number < frame and not self._stop.is_set:
                    self._scene.frame_set(number)

    def _scan(self, piece: Piece, number: int, bar: object) -> PointCloud | None:
        """None if it was stopped.

        By a scene of the engine's own: what a piece holds depends on no piece before it, its instance ids included.
        """
        import perfect_bvh

        from ..scanning import scan

        def advance(done: float) -> bool:
            bar.update(number + done - bar.n)  # type: ignore[attr-defined]
            return not self._stop.is_set

        arguments = self._arguments
        self._play_to(piece.frames[0])
        try:
            return scan(
                self._sensor.pattern,
                self._carrier,
                frames=piece.frames if arguments.frames else None,  # a whole pass of the current one
                steps_per_frame=arguments.steps,
                since=min(self._frames) if arguments.frames else None,
                threads=arguments.threads or 0,
                progress=advance,
            )
        except perfect_bvh.Cancelled:
            return None
        except ValueError as error:
            raise CommandError(f"frames {piece.frames[0]}-{piece.frames[1]}: {error}") from error

    def _write(self, place: PieceFolder, piece: Piece, cloud: PointCloud) -> None:
        from tqdm import tqdm

        try:
            place.write(piece, cloud)
        except OSError as error:
            raise CommandError(error.strerror or str(error)) from error
        for warning in cloud.warnings:
            if warning not in self._warned:
                self._warned.add(warning)
                tqdm.write(f"perfect-bvh: {warning}", file=sys.stderr)
