"""The chunks of a scan as a data set of KITTI's format or as a bag of ROS 2."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..live.scene_sync import SceneSync
from ..pieces.piece import Piece, PieceFolder
from ..pieces.work import Steps
from ..scanning.patterns import Float64Array
from ..scanning.piece_scan import ScanPlan, ScanWork
from ..scanning.point_cloud import PointCloud
from ..scanning.scan import MOST_SHORT
from ..scanning.stretches import Stretch, Sweep
from ..settings.scan_choices import KITTI, MCAP
from ..support.files import make_folder
from . import bag, kitti
from .shots import label, read_pixels, shoot

if TYPE_CHECKING:
    import bpy


# How far the calibrations of frames may differ: matrices of Blender are float32.
MOST_OFF = 1e-4
MOVES_ON_SENSOR = (
    "The camera moves against the sensor: sequences/00/calib.txt is right in the first frame alone; use those of each "
    "frame, in training/calib"
)


class DriveWork(ScanWork):
    """The chunks of a plan, with the camera's image of each frame."""

    def make(self, piece: Piece) -> Steps:
        """Scans a chunk with separate engine scenes: its content depends on no other chunk."""
        self._image_sync, self._label_sync = SceneSync(watch=False), SceneSync(watch=False)
        self._warnings: dict[str, None] = {}
        try:
            yield from super().make(piece)
        finally:
            self._image_sync.close()
            self._label_sync.close()

    def frame_of(self, stretch: Stretch) -> int:
        """The frame that an interval is in."""
        return self._plan.frames[0] if stretch.frame is None else stretch.frame

    def before(self, stretch: Stretch) -> Iterator[float]:
        """Makes the image where a frame begins."""
        if stretch.subframe == 0.0:
            yield from self.picture(stretch)

    def picture(self, stretch: Stretch) -> Iterator[float]:
        """Makes the image of a frame, and all that belongs to it."""
        raise NotImplementedError

    def shoot(self, stretch: Stretch, path: Path) -> dict[str, Any] | None:
        """Writes the image of a frame and returns its camera; None if there is none."""
        camera, warnings = shoot(self.view, self._image_sync, stretch.frame, path)
        self._warnings |= dict.fromkeys(warnings)
        return camera


class KittiWork(DriveWork):
    """Folders of files of each frame. Raises ValueError for negative frames, which no name of a file can have."""

    joined = kitti.JOINED

    def __init__(self, plan: ScanPlan, *others: Any) -> None:
        super().__init__(plan, *others)
        if min(plan.frames) < 0:
            raise ValueError(f"kitti numbers files by frames from 0 on, got {min(plan.frames)}: move the animation")
        self.pieces = [replace(piece, files=kitti.files_of(piece.frames)) for piece in self.pieces]
        self._cameras: dict[int, dict[str, Any]] = {}

    def picture(self, stretch: Stretch) -> Iterator[float]:
        frame = self.frame_of(stretch)
        path = self.place.path_of(kitti.file_of("image_2", frame))
        make_folder(path.parent)
        camera = self.shoot(stretch, path)
        if camera is None:
            scene = self.view.find().name
            raise ValueError(
                f"kitti: scene {scene!r} has no camera for images and boxes: add one, or write npz or mcap"
            )
        if "intrinsics" not in camera:
            raise ValueError(f"kitti: the camera must be a perspective one, not {camera['projection']}")
        self._cameras[frame] = camera
        labels = yield from label(self.view, self._label_sync, stretch.frame, self._plan.category, self._plan.threads)
        self._warnings |= dict.fromkeys(labels.warnings)
        kitti.write_text(self.place.path_of(kitti.file_of("label_2", frame)), kitti.label_lines(labels))

    def save(self, piece: Piece, cloud: PointCloud, sweeps: Sequence[Sweep]) -> dict[str, Any]:
        rate = self.view.find().render.fps / self.view.find().render.fps_base
        rows: list[dict[str, Any]] = []
        for sweep in sweeps:
            frame = self.frame_of(sweep.stretch)
            camera = self._cameras.pop(frame)
            between = _view(camera) @ _pose(sweep.path.first)
            points, text = (self.place.path_of(kitti.file_of(each, frame)) for each in ("velodyne", "calib"))
            kitti.write_points(points, _local(cloud, sweep), cloud.intensities[sweep.rows])
            kitti.write_text(text, kitti.calibration(camera["intrinsics"], between))
            facts = {"frame": frame, "seconds": (frame - min(self._plan.frames)) / rate}
            rows.append(facts | camera | {"camera_from_points": between.tolist()})
        first = np.array(rows[0]["camera_from_points"])
        if any(np.abs(first - row["camera_from_points"]).max() > MOST_OFF for row in rows):
            self._warnings[MOVES_ON_SENSOR] = None
        return {"drive": rows, "warnings": self._warnings}

    def join(self) -> None:
        """Writes poses, times and the layout of odometry, of all chunks in the folder. Raises OSError."""
        rows = [row for manifest in self.place.manifests() for row in manifest["drive"]]
        kitti.join(self.place.folder, rows)


class BagWork(DriveWork):
    """An MCAP file for each chunk, all of which are one bag in the end."""

    joined = (bag.METADATA,)

    def make(self, piece: Piece) -> Steps:
        self._bag = bag.Bag()
        yield from super().make(piece)

    def picture(self, stretch: Stretch) -> Iterator[float]:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "image.png")
            camera = self.shoot(stretch, path)
            if camera is None:
                self._warnings["The scene has no camera: the bag has no images"] = None
            else:
                self._bag.add_image(stretch.start, read_pixels(path), camera.get("intrinsics"))
                self._bag.add_pose(stretch.start, bag.CAMERA, np.linalg.inv(_view(camera)))
                if "intrinsics" not in camera:
                    self._warnings["The camera is no perspective one: the bag has no camera_info"] = None
        yield 0.0

    def save(self, piece: Piece, cloud: PointCloud, sweeps: Sequence[Sweep]) -> dict[str, Any]:
        for _, of_frame in groupby(sweeps, lambda sweep: self.frame_of(sweep.stretch)):
            parts = list(of_frame)
            begin, rows = parts[0].stretch.start, slice(parts[0].rows.start, parts[-1].rows.stop)
            positions = np.concatenate([_local(cloud, part) for part in parts])
            columns = cloud.intensities[rows], cloud.ring_ids[rows], cloud.times[rows] - begin
            self._bag.add_points(begin, positions, *columns)
            for part in parts:
                self._bag.add_pose(part.stretch.start, bag.SENSOR, _pose(part.path.first))
        if piece.last + 1 not in self._plan.frames:  # else the next chunk begins with it
            self._bag.add_pose(sweeps[-1].stretch.end, bag.SENSOR, _pose(sweeps[-1].path.last))
        return {"bag": self._bag.save(self.place.path_of(piece.files[0])), "warnings": self._warnings}

    def join(self) -> None:
        """Writes the metadata of the bag, of all chunks in the folder. Raises OSError."""
        bag.join(self.place.folder, [manifest["bag"] for manifest in self.place.manifests()])


WORKS: dict[str, type[DriveWork]] = {KITTI: KittiWork, MCAP: BagWork}


def scan_work(
    plan: ScanPlan,
    carrier: bpy.types.Object | None,
    place: PieceFolder,
    on_piece: Callable[[Piece, PointCloud], object] = lambda _piece, _cloud: None,
) -> ScanWork:
    """Returns the chunks of a scan in the plan's format; the arguments are those of `ScanWork`."""
    return WORKS.get(plan.suffix, ScanWork)(plan, carrier, place, on_piece)


def _view(camera: dict[str, Any]) -> Float64Array:
    """(4, 4) from the world to the camera."""
    return np.vstack([camera["world_to_camera"], [0.0, 0.0, 0.0, 1.0]])


def _pose(matrix: Float64Array) -> Float64Array:
    """(4, 4) from the axes of points to the world. matrix: from the sensor's space."""
    axes = np.eye(4)
    axes[:3, :3] = kitti.VELODYNE.T
    return matrix @ axes


def _local(cloud: PointCloud, sweep: Sweep) -> Float64Array:
    """(N, 3) the points of an interval in the axes of points, each at its own time."""
    stretch = sweep.stretch
    shares = (cloud.times[sweep.rows] - stretch.start) / max(stretch.end - stretch.start, MOST_SHORT)
    local: Float64Array = sweep.path.undo(cloud.positions[sweep.rows], shares) @ kitti.VELODYNE.T
    return local
