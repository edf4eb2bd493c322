"""A scan over frames into a folder, in chunks: its plan, and its work, for the command line and the button.

The content of a chunk depends only on its frames and on the plan. A separate engine scene scans each chunk, so its
bytes are always the same, for any caller and after any other chunks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import bpy

from ..live.scene_view import SceneView
from ..pieces.piece import Piece, PieceFolder, runs_of, scene_inputs
from ..pieces.work import Done, Outcome, PieceWork, Steps
from ..settings.preferences import denoiser_in_use
from ..settings.scan_choices import FORMATS, KITTI
from ..statistics.words import count_of
from .formats import label_columns, save_cloud
from .light.model import Light
from .outcomes import RayCounts
from .patterns import Pattern
from .point_cloud import PointCloud
from .scan import Scanner, find_sensor
from .sensor_files import Sensor
from .stretches import Stretch, Sweep

BEFORE = "points_"  # of the names of all files


@dataclass(frozen=True, slots=True)
class ScanPlan:
    """The settings that all chunks of a scan share.

    frames: in any order; they are split into chunks of at most `size` consecutive frames. is_one_pass: a whole sweep of
    the sensor in the current frame, which is in `frames`. suffix: of the format, such as ".npz". steps: time samples of
    a frame. threads: 0 for all. seed: of the sensor's noise.
    labels: names of further columns. boxes: whether files have the boxes of object instances. category: the label with
    the classes of KITTI's boxes; None for the objects' names. exclude_mount: as in `scan`. for_viewport: scans the
    scene of viewports instead of a render's.
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
    boxes: bool = False
    category: str | None = None
    exclude_mount: bool | None = None
    for_viewport: bool = False

    def pieces(self) -> list[Piece]:
        """Returns the chunks in the order of their frames."""
        return pieces_of(self.frames, self.size, self.suffix)

    def folder(self, path: Path, inputs: dict[str, Any]) -> PieceFolder:
        """Returns the folder of chunks. inputs: see below."""
        return PieceFolder(path, inputs, BEFORE, "scan")

    def inputs(self, arguments: Any, carrier: bpy.types.Object | None) -> dict[str, Any]:
        """Returns the inputs of chunks. carrier: None for the camera of each frame. Else see `scene_inputs`."""
        return scene_inputs(
            arguments,
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
            boxes=self.boxes,
            category=self.category,
            exclude_mount=self.exclude_mount,
            denoiser=denoiser_in_use() if FORMATS[self.suffix].is_drive else None,
        )

    def scanner(
        self,
        piece: Piece,
        carrier: bpy.types.Object | None,
        before: Callable[[Stretch], Iterator[float]] = lambda _: iter(()),
    ) -> Scanner:
        """Makes the scanner of one chunk, in the context's scene. before, and the ValueErrors: see `Scanner`."""
        return Scanner(
            self.sensor,
            carrier,
            frames=None if self.is_one_pass else (piece.first, piece.last),
            steps_per_frame=self.steps,
            since=None if self.is_one_pass else min(self.frames),
            threads=self.threads,
            seed=self.seed,
            labels=self.labels,
            boxes=self.boxes,
            whole_passes=self.suffix == KITTI,
            before=before,
            exclude_mount=self.exclude_mount,
            for_viewport=self.for_viewport,
        )


class ScanWork(PieceWork):
    """The chunks of a plan, in the scene and view layer of the context.

    carrier: the object that carries the sensor, None for the camera of each frame. place: the folder of the chunks.
    on_piece: called with each cloud before it is written; an exception ends the run, and the chunk is not written.
    """

    def __init__(
        self,
        plan: ScanPlan,
        carrier: bpy.types.Object | None,
        place: PieceFolder,
        on_piece: Callable[[Piece, PointCloud], object] = lambda _piece, _cloud: None,
    ) -> None:
        where = bpy.context.scene, bpy.context.view_layer
        super().__init__(SceneView("scan", *where, for_viewport=plan.for_viewport), plan.frames)
        self.pieces, self.place = plan.pieces(), place
        self._plan = plan
        self._on_piece = on_piece
        self._carrier = None if carrier is None else (carrier.name, carrier.session_uid)
        self._scanner: Scanner | None = None

    @property
    def built_share(self) -> float | None:
        """The finished share of an interval's trees while they are being built."""
        return None if self._scanner is None else self._scanner.built_share

    def make(self, piece: Piece) -> Steps:
        """Yields as often as `Scanner.steps` does, and raises what that does, and OSError for a file."""
        scene = self.view.find()
        with bpy.context.temp_override(scene=scene, view_layer=self.view.find_layer()):
            carrier = None if self._carrier is None else find_sensor(scene, *self._carrier)
            self._scanner = scanner = self._plan.scanner(piece, carrier, self.before)
        yield from scanner.steps()
        cloud = scanner.result()
        self._scanner = None
        self._on_piece(piece, cloud)
        facts = self.save(piece, cloud, scanner.sweeps)
        cloud = replace(cloud, warnings=(*cloud.warnings, *facts.pop("warnings", ())))
        _finish(self.place, piece, cloud, **facts)
        yield Done({"points": len(cloud), **cloud.ray_outcomes.named}, cloud.warnings)

    def before(self, stretch: Stretch) -> Iterator[float]:
        """Does the work before an interval is scanned, in steps; there is none for files of points alone."""
        yield from ()

    def save(self, piece: Piece, cloud: PointCloud, sweeps: Sequence[Sweep]) -> dict[str, Any]:
        """Writes the files of a chunk; returns facts for its manifest, maybe with further warnings. Raises OSError."""
        path = self.place.path_of(piece.files[0])
        save_cloud(cloud, path)
        return {"labels": cloud.described_labels(label_columns(cloud.labels, path.suffix.lower()))}

    def summary(self, outcome: Outcome) -> tuple[str, ...]:
        """How many points there are, and what became of the rays."""
        points = count_of(outcome.counts.get("points", 0), "point")
        return (points, str(ray_counts(outcome))) if outcome.written else (points,)


def ray_counts(outcome: Outcome) -> RayCounts:
    """Sums up the outcomes of the rays of the scanned chunks."""
    return RayCounts(**{name: count for name, count in outcome.counts.items() if name != "points"})


def pieces_of(frames: Sequence[int], size: int, suffix: str = ".npz") -> list[Piece]:
    """Splits frames into runs of at most `size` consecutive frames, in the order of the frames."""
    stems = [(run, f"{BEFORE}{run[0]:04d}-{run[-1]:04d}") for run in runs_of(frames, size)]
    return [Piece(run, stem, (f"{stem}{suffix}",)) for run, stem in stems]


def sensor_input(pattern: Pattern) -> dict[str, Any]:
    """A sensor as an input of chunks."""
    values = {
        name: None if value == math.inf else value
        for name, value in asdict(pattern).items()  # type: ignore[call-overload]
    }
    return {"kind": type(pattern).__name__, **values}


def light_input(light: Light | None) -> dict[str, Any] | None:
    """Returns the light settings of a sensor's file as JSON values."""
    return None if light is None else asdict(light)


def _finish(place: PieceFolder, piece: Piece, cloud: PointCloud, **facts: Any) -> None:
    """Writes the manifest of a chunk whose files are there. Raises OSError."""
    stretches = len(piece.frames) * place.inputs["steps"]
    # Of a single stretch, of whose way nothing is known but its ends, there are no errors.
    is_known = stretches > 1 and not place.inputs["is_one_pass"]
    place.finish(
        piece,
        rays=cloud.ray_count,
        points=len(cloud),
        ray_outcomes=cloud.ray_outcomes.named,
        object_names=list(cloud.object_names),
        material_names=list(cloud.material_names),
        **facts,
        **{name: getattr(cloud, name) if is_known else None for name in ("pose_error", "scene_error")},
        warnings=list(cloud.warnings),
    )
