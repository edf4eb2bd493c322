"""A scan over frames into a folder, piece by piece: its plan, and its steps for the button.

The command line takes the plan alone: what runs its pieces, here or by workers, runs other commands' pieces as well.

What a piece holds depends on its frames and on the plan alone: each is scanned by a scene of the engine's own, so that
it is the same bytes whoever asked for it, and whatever pieces were there before.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ..extract.simulations import has_simulations
from ..live.scene_view import SceneView
from ..pieces.folder import PieceFolder
from ..pieces.piece import Piece
from ..pieces.scene_inputs import scene_inputs
from .outcomes import RayCounts
from .pieces import BEFORE, light_input, pieces_of, sensor_input, write_piece
from .point_cloud import PointCloud
from .scan import Scanner, find_sensor
from .sensor_files import Sensor


@dataclass(frozen=True, slots=True)
class ScanPlan:
    """What all pieces of a scan have in common.

    frames: in any order; of them pieces are made of at most `size` that follow each other. is_one_pass: a whole pass of
    the sensor in the current frame, which `frames` names. suffix: of the format, such as ".npz". steps: key moments of
    a frame. threads: 0 for all. seed: of the sensor's noise.
    labels: names of further columns. exclude_mount: as `scan` has it. for_viewport: what viewports show is scanned, not
    what a render does.
    """

    sensor: Sensor
    frames: tuple[int, ...]
    is_one_pass: bool
    suffix: str = ".npz"
    size: int = 10
    steps: int = 1
    threads: int = 0
    seed: int = 0
    labels: tuple[str, ...] = ()
    exclude_mount: bool | None = None
    for_viewport: bool = False

    def pieces(self) -> list[Piece]:
        """In the order of their frames."""
        return pieces_of(self.frames, self.size, self.suffix)

    def folder(self, path: Path, inputs: dict[str, Any]) -> PieceFolder:
        """Where pieces go. inputs: see below."""
        return PieceFolder(path, inputs, BEFORE, "scan")

    def inputs(
        self, scene_file: Path, carrier: bpy.types.Object | None, *, autoexec: bool, allow_missing: bool
    ) -> dict[str, Any]:
        """What the bytes of pieces depend on. scene_file: that is open. carrier: None for the camera of each frame."""
        return scene_inputs(
            scene_file,
            autoexec=autoexec,
            allow_missing=allow_missing,
            sensor=sensor_input(self.sensor.pattern),
            light=light_input(self.sensor.light),
            seed=self.seed,
            on=None if carrier is None else carrier.name,
            viewport=self.for_viewport,
            steps=self.steps,
            begins=min(self.frames),
            is_one_pass=self.is_one_pass,
            format=self.suffix,
            labels=list(self.labels),
            exclude_mount=self.exclude_mount,
        )

    def scanner(self, piece: Piece, carrier: bpy.types.Object | None) -> Scanner:
        """Of one piece, in the context's scene. Raises ValueError like `Scanner`."""
        return Scanner(
            self.sensor,
            carrier,
            frames=None if self.is_one_pass else (piece.first, piece.last),
            steps_per_frame=self.steps,
            since=None if self.is_one_pass else min(self.frames),
            threads=self.threads,
            seed=self.seed,
            labels=self.labels,
            exclude_mount=self.exclude_mount,
            for_viewport=self.for_viewport,
        )


class PieceScan:
    """One run over the pieces of a plan, in the scene and view layer of the context.

    carrier: the object that carries the sensor, None for the camera of each frame. place: where pieces go, prepared:
    what counts as done there is kept.
    on_piece: called with each cloud before it is written; what it raises ends the run, and the piece is not written.
    """

    def __init__(
        self,
        plan: ScanPlan,
        carrier: bpy.types.Object | None,
        place: PieceFolder,
        *,
        on_piece: Callable[[Piece, PointCloud], object] | None = None,
    ) -> None:
        self.pieces = plan.pieces()
        self.number = 1
        """Of the piece that is worked on, from 1."""
        self.written = self.kept = self.points = 0
        self.counts = RayCounts()
        self.warnings: dict[str, None] = {}
        """Of the pieces that were scanned, each once."""
        self._plan = plan
        self._place = place
        self._on_piece = on_piece
        where = bpy.context.scene, bpy.context.view_layer
        self._where = SceneView("scan", *where, for_viewport=plan.for_viewport)
        self._carrier = None if carrier is None else (carrier.name, carrier.session_uid)
        self._scanner: Scanner | None = None
        self._played_to = min(plan.frames) - 1

    @property
    def built_share(self) -> float | None:
        """How much of the trees of a stretch is built, as long as they are."""
        return None if self._scanner is None else self._scanner.built_share

    def steps(self) -> Generator[float, None, None]:
        """Does it; yields how many pieces are done, with fractions, as often as `Scanner.steps` does.

        Closing it gives up the piece that is under way; whole ones stay. Raises what that does, and OSError for a file
        that cannot be written.
        """
        scene = self._where.find()
        camera_uid = scene.camera.session_uid if scene.camera else 0
        frame = scene.frame_current, scene.frame_subframe, camera_uid
        try:
            for before, piece in enumerate(self.pieces):
                self.number = before + 1
                yield before
                if self._place.is_done(piece):
                    self.kept += 1
                    continue
                yield from self._play_to(piece.first, before)
                yield from self._scan(piece, before)
                self._played_to = piece.last
            yield len(self.pieces)
        finally:
            self._where.set_frame_back(*frame)

    def _play_to(self, frame: int, done: float) -> Generator[float, None, None]:
        """Through the frames of pieces that were there, if anything is simulated: it depends on those before it."""
        if self._plan.is_one_pass or not has_simulations(self._where.find()):
            return
        for number in sorted(set(self._plan.frames)):
            if self._played_to < number < frame:
                self._where.find().frame_set(number)
                yield done

    def _scan(self, piece: Piece, before: int) -> Generator[float, None, None]:
        scene = self._where.find()
        with bpy.context.temp_override(scene=scene, view_layer=self._where.find_layer()):
            self._scanner = self._plan.scanner(piece, self._find_carrier(scene))
        with closing(self._scanner.steps()) as steps:  # in the middle of a build, too: the frame is set back
            for done in steps:
                yield before + min(done, 0.999)
        cloud = self._scanner.result()
        self._scanner = None
        if self._on_piece is not None:
            self._on_piece(piece, cloud)
        write_piece(self._place, piece, cloud)
        self.written, self.points = self.written + 1, self.points + len(cloud)
        self.counts += cloud.ray_outcomes
        self.warnings |= dict.fromkeys(cloud.warnings)

    def _find_carrier(self, scene: bpy.types.Scene) -> bpy.types.Object | None:
        return None if self._carrier is None else find_sensor(scene, *self._carrier)
