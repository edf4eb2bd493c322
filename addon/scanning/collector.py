"""Gathers the hits of many batches into one point cloud, in which ids mean the same throughout."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..sync.label_columns import LabelColumn
from .light.model import LUMINANCE
from .outcomes import Outcomes, RayCounts
from .point_cloud import COLUMNS, PointCloud

if TYPE_CHECKING:
    from perfect_bvh import Hits

    from ..live.scene_sync import SceneSync
    from ..sync.label_columns import LabelTable, SceneLabel
    from .light.beams import Returns
    from .patterns import Rays

EMPTY = {
    "positions": np.empty((0, 3)),
    "distances": np.empty(0),
    "normals": np.empty((0, 3), np.float32),
    "object_ids": np.empty(0, np.int32),
    "instance_ids": np.empty(0, np.int32),
    "material_ids": np.empty(0, np.int32),
    "times": np.empty(0),
    "ray_ids": np.empty(0, np.int64),
    "ring_ids": np.empty(0, np.int32),
    "incidences": np.empty(0, np.float32),
    "intensities": np.empty(0, np.float32),
    "spacings": np.empty(0, np.float32),
    "return_ids": np.empty(0, np.int32),
    "return_counts": np.empty(0, np.int32),
}

NO_LABELS: Mapping[str, Any] = {}
WITHOUT_MATERIAL = 0.8  # as Blender shows it


class _Names:
    """Numbers things by their session uid, in the order in which they are first met, and keeps their names."""

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
        self._labels: list[dict[str, npt.NDArray[Any]]] = []
        self.counts = RayCounts()

    @property
    def next_ray_id(self) -> int:
        """What the first ray of the next batch has."""
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

        sync: what was traced, not updated since; its material slots were read. labels: of its record, the same names
        each time.
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
                    "object_ids": self._object_ids(hits.instance_ids[rows], sync),
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
    ) -> PointCloud:
        """Everything that was added. tables: of the labels."""
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
        )

    def _label(self, name: str, table: LabelTable) -> npt.NDArray[Any]:
        return np.concatenate([table.encode(np.empty(0)), *(piece[name] for piece in self._labels)])

    def _object_ids(self, instance_ids: npt.NDArray[np.int32], sync: SceneSync) -> npt.NDArray[np.int32]:
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
    """(N,) cosines between rays and normals, whichever side of the surface is met."""
    along = np.einsum("ij,ij->i", directions, normals) / np.linalg.norm(directions, axis=1)
    return np.minimum(np.abs(along), 1.0).astype(np.float32)


def _luminances(material_ids: npt.NDArray[np.int32], sync: SceneSync) -> npt.NDArray[np.float32]:
    """(N,) of the viewport colours of materials; id -1: none."""
    known = [float(np.dot(LUMINANCE, material.color[:3])) for material in sync.record.materials]
    return np.array([*known, WITHOUT_MATERIAL], np.float32)[material_ids]
