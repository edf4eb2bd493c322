"""The measurements of a scan, as columns, and as a file. Does not depend on Blender."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..support.files import replacing, write_arrays
from ..sync.lookup import LabelColumn
from .light.model import LUMINANCE
from .outcomes import Outcomes, RayCounts

if TYPE_CHECKING:
    from perfect_bvh import Hits

    from ..live.scene_sync import SceneSync
    from ..sync.lookup import LabelTable, SceneLabel
    from .light.beams import Returns
    from .patterns import Rays


class Column(NamedTuple):
    """A column of points. singular: its name for a single point. row: the shape of a point's value."""

    singular: str
    dtype: type[np.generic]
    row: tuple[int, ...] = ()


# In the order of the file; each holds one row a point.
COLUMNS = {
    "positions": Column("position", np.float64, (3,)),
    "distances": Column("distance", np.float64),
    "normals": Column("normal", np.float32, (3,)),
    "object_ids": Column("object_id", np.int32),
    "instance_ids": Column("instance_id", np.int32),
    "material_ids": Column("material_id", np.int32),
    "times": Column("time", np.float64),
    "ray_ids": Column("ray_id", np.int64),
    "ring_ids": Column("ring", np.int32),
    "incidences": Column("incidence", np.float32),
    "intensities": Column("intensity", np.float32),
    "spacings": Column("spacing", np.float32),
    "return_ids": Column("return_id", np.int32),
    "return_counts": Column("return_count", np.int32),
}
# What columns are called where a table has one for each number of a point.
AXES = {"positions": ("x", "y", "z"), "normals": ("nx", "ny", "nz")}
# Of boxes, in files after "box_".
BOX_COLUMNS = (
    *("frames", "times", "instance_ids", "object_ids", "centers", "sizes", "axes"),
    *("point_counts", "visible_shares"),
)
# What else files and Blender's points have a name for.
_OTHERS = (
    *("object_names", "material_names", "ray_count", "pose_error", "scene_error", "labels", "boxes"),
    *(f"box_{name}" for name in BOX_COLUMNS),
    *("radius", "color"),
)


@dataclass(frozen=True, slots=True)
class PointCloud:
    """N points where rays hit surfaces, in the order in which the rays were cast; misses are left out.

    Attributes:
        positions: (N, 3) float64, world space.
        distances: (N,) float64 from the sensor, in world units.
        normals: (N, 3) float32, unit, of the triangle's plane, by its winding.
        object_ids: (N,) int32, rows of object_names.
        material_ids: (N,) int32, rows of material_names, -1 for none.
        instance_ids: (N,) int32: a number for each instance of an object; it is only valid within a scan.
        times: (N,) float64, seconds since the scan began.
        ray_ids: (N,) int64: the number of the ray, counted over the whole scan.
        ring_ids: (N,) int32: the line of a LiDAR, in the order of its elevations, or the row of a camera's picture.
        incidences: (N,) float32, cosine of the angle between ray and normal: 1 straight on, 0 grazing.
        intensities: (N,) float32, the light that a diffuse surface returns, at any distance: the luminance of the
            material's viewport colour times the incidence. With a sensor's light: the light that the sensor receives,
            1 for a white surface that fills the beam, hit perpendicularly, at `Optics.reference` (or, if calibrated,
            at any distance); more for mirrors. Then normals, ids and incidences belong to the surface that returned
            the most of an echo; distances are the length of the light's path, as measured; and positions are at that
            distance along the ray, even if a mirror had bent its path.
        spacings: (N,) float32, the distance of neighbouring rays at the point.
        return_ids, return_counts: (N,) int32, the number of the point's echo in its ray's beam, from 0, the nearest
            first, and the number of kept echoes of the beam: 0 and 1 without light.
        labels: Further columns by the requested names: custom properties, collections and others, see `scan`.
        boxes: Empty unless requested: columns of the 3D boxes of all object instances that rays go through, hidden or
            not, a row for each in each interval. frames, times: (B,) float64, the frame, and the seconds since the scan
            began, at the interval's beginning, where the box is. instance_ids, object_ids: (B,) int32, as those of
            points. centers: (B, 3) float64, world space. sizes: (B, 3) float64, along the axes. axes: (B, 3, 3)
            float64, rows are unit vectors of the object's x, y and z. point_counts: (B,) int64. visible_shares: (B,)
            float32, the share of the rays through the instance that hit nothing before it; glass counts as solid. 0 if
            only the edge of a beam hits it.
        ray_count: The number of rays cast.
        ray_outcomes: The outcomes of the rays, a `RayCounts`, whose counts add up to ray_count in every cloud of a
            scan.
        warnings: Data that could not be read or followed, and why a scan is useless, as sentences.
        pose_error, scene_error: In world units, the error of straight paths between the time samples of a LiDAR's
            frames: an estimate of how far points may be off because the sensor, or the surface that it hit, was not
            quite there. Each is an eighth of the largest second difference of three consecutive time samples (for
            rotations, their difference from even ones): of the sensor's poses, at the farthest point; of the corners of
            the boxes of all instances that moved, and of vertices that deformed, hit or not. More steps per frame
            reduce both. They are estimates, no bounds. Oscillations within an interval, or turns of more than half a
            revolution, do not show at its ends. A single interval gives no estimate. Objects that could not be
            followed, which `warnings` list, do not count. A change of speed exactly at a time sample counts, although
            it is followed. Where rays graze a surface, points are off by more. 0 for scans at single times.
    """

    positions: npt.NDArray[np.float64]
    distances: npt.NDArray[np.float64]
    normals: npt.NDArray[np.float32]
    object_ids: npt.NDArray[np.int32]
    instance_ids: npt.NDArray[np.int32]
    material_ids: npt.NDArray[np.int32]
    times: npt.NDArray[np.float64]
    ray_ids: npt.NDArray[np.int64]
    ring_ids: npt.NDArray[np.int32]
    incidences: npt.NDArray[np.float32]
    intensities: npt.NDArray[np.float32]
    spacings: npt.NDArray[np.float32]
    return_ids: npt.NDArray[np.int32]
    return_counts: npt.NDArray[np.int32]
    object_names: tuple[str, ...]
    material_names: tuple[str, ...]
    ray_count: int
    warnings: tuple[str, ...] = ()
    pose_error: float = 0.0
    scene_error: float = 0.0
    labels: Mapping[str, LabelColumn] = field(default_factory=dict)
    boxes: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)
    ray_outcomes: RayCounts = field(default_factory=RayCounts)

    def __len__(self) -> int:
        return len(self.positions)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes everything into an .npz file (the ending is added if it is missing) and returns its path.

        A file of that name is replaced once the new one is complete: a failure leaves it as it was.

        Raises:
            OSError: With the reason if it cannot be written.
        """
        path = Path(path)
        if path.suffix.lower() != ".npz":
            path = path.with_name(path.name + ".npz")
        with replacing(path) as name:
            self.write_npz(name)
        return path

    def described_labels(self, columns: Mapping[str, str]) -> dict[str, Any]:
        """Returns the meaning of the labels' values, as JSON has it. columns: each label's name in the file."""
        return {name: {"column": columns[name], **label.table.described()} for name, label in self.labels.items()}

    def write_npz(self, path: Path) -> None:
        """Writes to an open file, directly: `save` protects an existing file.

        Labels have the names of `column_names`; `labels` describes their values, as JSON.
        """
        names = column_names(self.labels)
        arrays = {name: getattr(self, name) for name in COLUMNS} | {
            "object_names": np.array(self.object_names, dtype=np.str_),
            "material_names": np.array(self.material_names, dtype=np.str_),
            "ray_count": np.array(self.ray_count, np.int64),
            "pose_error": np.array(self.pose_error, np.float64),
            "scene_error": np.array(self.scene_error, np.float64),
            "labels": np.array(json.dumps(self.described_labels(names))),
        }
        arrays |= {f"box_{name}": values for name, values in self.boxes.items()}
        arrays |= {names[name]: label.values for name, label in self.labels.items()}
        write_arrays(path, arrays)


def column_names(labels: Iterable[str]) -> dict[str, str]:
    """Returns the column name of each label: the label's own name, or `label_NAME` if that is taken."""
    singulars = (column.singular for column in COLUMNS.values())
    taken = {*COLUMNS, *singulars, *_OTHERS, *(name for names in AXES.values() for name in names)}
    # Readers of some formats do not tell small letters from capitals.
    return {name: f"label_{name}" if name.lower() in taken else name for name in labels}


# Collector -----------------------------------------------------------------------------------------------------------
# Gathers the hits of many batches into one point cloud, in which ids mean the same throughout.


EMPTY = {name: np.empty((0, *column.row), column.dtype) for name, column in COLUMNS.items()}
NO_LABELS: Mapping[str, Any] = {}
WITHOUT_MATERIAL = 0.8  # as Blender shows it


class _Names:
    """Numbers data-blocks by session uid, in the order in which they are first hit, and keeps their names."""

    def __init__(self) -> None:
        self._rows: dict[int, int] = {}
        self.names: list[str] = []

    def row_of(self, uid: int, name: str) -> int:
        row = self._rows.setdefault(uid, len(self.names))
        if row == len(self.names):
            self.names.append(name)
        return row


class Collector:
    """Takes batches, one after the other, and makes the point cloud of them all."""

    def __init__(self, rays_before: int = 0) -> None:
        """rays_before: how many the scan has cast before these."""
        self._rays_before = rays_before
        self._pieces: list[dict[str, npt.NDArray[Any]]] = []
        self._objects = _Names()
        self._materials = _Names()
        self._ray_count = 0
        self.point_count = 0
        self._labels: list[dict[str, npt.NDArray[Any]]] = []
        self.counts = RayCounts()

    @property
    def next_ray_id(self) -> int:
        """The number of the first ray of the next batch."""
        return self._rays_before + self._ray_count

    def count(self, outcomes: Outcomes) -> None:
        """Counts what became of the rays of a batch."""
        self.counts += RayCounts.of(outcomes)

    def add(
        self,
        hits: Hits,
        rays: Rays,
        directions: npt.NDArray[np.float64],
        sync: SceneSync,
        labels: Mapping[str, SceneLabel] = NO_LABELS,
    ) -> None:
        """Keeps the hits of a batch of rays. directions: (R, 3) of the rays, in world space.

        Args:
            sync: The traced scene, not updated since; its material slots were read.
            labels: Of its record, the same names each time.
        """
        self._add(hits, rays, np.arange(len(rays)), directions, sync, labels)
        self._ray_count += len(rays)

    def add_returns(
        self, returns: Returns, rays: Rays, sync: SceneSync, labels: Mapping[str, SceneLabel] = NO_LABELS
    ) -> None:
        """The same of what beams have returned, which may be several echoes of a ray."""
        self._add(returns.hits, rays, returns.beams, returns.directions, sync, labels, returns)
        self._ray_count += len(rays)

    def _add(
        self,
        hits: Hits,
        rays: Rays,
        ray_rows: npt.NDArray[np.int64],
        directions: npt.NDArray[np.float64],
        sync: SceneSync,
        labels: Mapping[str, SceneLabel],
        returns: Returns | None = None,
    ) -> None:
        """ray_rows: of each hit, which of the rays it is of. returns: where hits are echoes of beams."""
        rows = np.flatnonzero(hits.instance_ids >= 0)
        self.point_count += len(rows)
        if len(rows):
            of_rays = ray_rows[rows]
            materials = sync.material_ids(hits)[rows]
            incidences = _incidences(directions[rows], hits.geometric_normals[rows])
            instances = sync.instance_rows(hits.instance_ids[rows]) if labels else rows
            self._labels.append({name: label.at(instances, materials) for name, label in labels.items()})
            self._pieces.append(
                {
                    "positions": hits.positions[rows],
                    "distances": hits.distances[rows],
                    "normals": hits.geometric_normals[rows],
                    "object_ids": self.object_ids(hits.instance_ids[rows], sync),
                    "instance_ids": hits.instance_ids[rows],
                    "material_ids": self._material_ids(materials, sync),
                    "times": rays.times[of_rays],
                    "ray_ids": self.next_ray_id + of_rays.astype(np.int64),
                    "ring_ids": rays.ring_ids[of_rays],
                    "incidences": incidences,
                    "intensities": incidences * _luminances(materials, sync)
                    if returns is None
                    else returns.intensities[rows],
                    "spacings": (rays.gap + rays.spread * hits.distances[rows]).astype(np.float32),
                    "return_ids": np.zeros(len(rows), np.int32) if returns is None else returns.return_ids[rows],
                    "return_counts": np.ones(len(rows), np.int32) if returns is None else returns.return_counts[rows],
                }
            )

    def point_cloud(
        self,
        warnings: tuple[str, ...],
        pose_error: float,
        scene_error: float,
        tables: Mapping[str, LabelTable] = NO_LABELS,
        boxes: Mapping[str, npt.NDArray[Any]] = NO_LABELS,
    ) -> PointCloud:
        """Everything that was added. tables: of the labels. boxes: see `PointCloud.boxes`."""
        columns = {name: np.concatenate([EMPTY[name], *(piece[name] for piece in self._pieces)]) for name in COLUMNS}
        return PointCloud(
            **columns,
            object_names=tuple(self._objects.names),
            material_names=tuple(self._materials.names),
            ray_count=self._ray_count,
            ray_outcomes=self.counts,
            warnings=warnings,
            pose_error=pose_error,
            scene_error=scene_error,
            labels={name: LabelColumn(self._label(name, table), table) for name, table in tables.items()},
            boxes=boxes,
        )

    def _label(self, name: str, table: LabelTable) -> npt.NDArray[Any]:
        return np.concatenate([table.encode(np.empty(0)), *(piece[name] for piece in self._labels)])

    def instances_from(self, point: int) -> npt.NDArray[np.int32]:
        """The instance ids of the points from this one on."""
        found, left = [EMPTY["instance_ids"]], self.point_count - point
        for piece in reversed(self._pieces):
            if left <= 0:
                break
            found.append(piece["instance_ids"][-left:])
            left -= len(found[-1])
        return np.concatenate(found)

    def object_ids(self, instance_ids: npt.NDArray[np.int32], sync: SceneSync) -> npt.NDArray[np.int32]:
        """Returns rows of the cloud's object_names."""
        instances, inverse = np.unique(instance_ids, return_inverse=True)
        found = sync.describe(instances)
        rows = [
            self._objects.row_of(int(uid), str(name)) for uid, name in zip(found.session_uids, found.names, strict=True)
        ]
        return np.array(rows, np.int32)[inverse]

    def _material_ids(self, material_ids: npt.NDArray[np.int32], sync: SceneSync) -> npt.NDArray[np.int32]:
        present, inverse = np.unique(material_ids, return_inverse=True)
        materials = sync.record.materials
        rows = [
            -1 if row < 0 else self._materials.row_of(materials[row].session_uid, materials[row].name)
            for row in present
        ]
        return np.array(rows, np.int32)[inverse]


def _incidences(directions: npt.NDArray[np.float64], normals: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(N,) cosines between rays and normals, for hits on either side of the surface."""
    along = np.einsum("ij,ij->i", directions, normals) / np.linalg.norm(directions, axis=1)
    return np.minimum(np.abs(along), 1.0).astype(np.float32)


def _luminances(material_ids: npt.NDArray[np.int32], sync: SceneSync) -> npt.NDArray[np.float32]:
    """(N,) of the viewport colours of materials; id -1: none."""
    known = [float(np.dot(LUMINANCE, material.color[:3])) for material in sync.record.materials]
    return np.array([*known, WITHOUT_MATERIAL], np.float32)[material_ids]
