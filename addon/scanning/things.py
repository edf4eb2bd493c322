"""The boxes of the object instances in a sensor's reach, with the points on each. Does not depend on Blender."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..sync.boxes import boxes_of
from ..sync.records import VISIBLE_TO_CAMERA
from .point_cloud import BOX_COLUMNS, Collector
from .stretch_sync import RAYS_IN_A_STEP

if TYPE_CHECKING:
    from .stretch_sync import TracedStretch

Columns = dict[str, npt.NDArray[Any]]
_SHAPES = {"centers": (0, 3), "sizes": (0, 3), "axes": (0, 3, 3)}
_TYPES = {"instance_ids": np.int32, "object_ids": np.int32, "point_counts": np.int64, "visible_shares": np.float32}


class BoxCollector:
    """Gathers the rows of `PointCloud.boxes`, interval after interval."""

    def __init__(self) -> None:
        self._parts: list[Columns] = [
            {name: np.empty(_SHAPES.get(name, 0), _TYPES.get(name, np.float64)) for name in BOX_COLUMNS}
        ]

    def add(self, frame: float, start: float, cast: TracedStretch, collector: Collector, first: int) -> None:
        """Adds an interval whose rays are cast.

        Args:
            frame, start: When it begins, as a frame and in seconds since the scan began.
            first: The number of its first point in the collector.
        """
        met, seen = _count(cast)
        points = _counted(collector.instances_from(first))
        instances = np.array(sorted(met.keys() | points.keys()), np.int32)
        found = boxes_of(cast.sync.record, cast.sync.instance_rows(instances))
        counts = [np.array([each.get(one, 0) for one in instances.tolist()], np.int64) for each in (met, seen, points)]
        self._parts.append(
            {
                "frames": np.full(len(instances), float(frame)),
                "times": np.full(len(instances), start),
                "instance_ids": instances,
                "object_ids": collector.object_ids(instances, cast.sync),
                **found._asdict(),
                "point_counts": counts[2],
                "visible_shares": (counts[1] / np.maximum(counts[0], 1)).astype(np.float32),
            }
        )

    def columns(self) -> Columns:
        """Returns all rows, as `PointCloud.boxes` has them."""
        return {name: np.concatenate([part[name] for part in self._parts]) for name in BOX_COLUMNS}


def _count(cast: TracedStretch) -> tuple[dict[int, int], dict[int, int]]:
    """Counts the rays that go through each instance, and those that meet it first."""
    met, seen = dict[int, int](), dict[int, int]()
    rays = cast.rays
    origins, directions = cast.path.place(rays.origins, rays.directions, cast.shares)
    limits = {"t_min": rays.t_min, "t_max": rays.t_max, "mask": VISIBLE_TO_CAMERA, "threads": cast.threads}
    for begin in range(0, len(rays), RAYS_IN_A_STEP):
        rows = slice(begin, begin + RAYS_IN_A_STEP)
        times = cast.shares[rows] if cast.moves else 0.0
        listed = cast.snapshot.list_intersections(
            origins[rows], directions[rows], times=times, fields=("instance_ids",), **limits
        )
        ids = listed.hits.instance_ids
        pairs = np.unique(ids.astype(np.int64) << 32 | listed.ray_indices)
        nearest = ids[listed.ray_splits[:-1][np.diff(listed.ray_splits) > 0]]
        for counts, instances in ((met, pairs >> 32), (seen, nearest)):
            for one, count in _counted(instances).items():
                counts[one] = counts.get(one, 0) + count
    return met, seen


def _counted(values: npt.NDArray[Any]) -> dict[int, int]:
    found, counts = np.unique(values, return_counts=True)
    return dict(zip(found.tolist(), counts.tolist(), strict=True))
