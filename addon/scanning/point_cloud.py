"""What a scan has measured, as columns, and as a file. Knows no Blender."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..support.arrays import write_arrays
from ..support.files import replacing
from ..sync.label_columns import LabelColumn
from .outcomes import RayCounts

# In the order of the file; each holds one row a point.
COLUMNS = (
    "positions",
    "distances",
    "normals",
    "object_ids",
    "instance_ids",
    "material_ids",
    "times",
    "ray_ids",
    "ring_ids",
    "incidences",
    "intensities",
    "spacings",
    "return_ids",
    "return_counts",
)

# What columns are called where a table has one for each number of a point.
AXES = {"positions": ("x", "y", "z"), "normals": ("nx", "ny", "nz")}
SINGULAR = {
    "distances": "distance",
    "object_ids": "object_id",
    "instance_ids": "instance_id",
    "material_ids": "material_id",
    "times": "time",
    "ray_ids": "ray_id",
    "ring_ids": "ring",
    "incidences": "incidence",
    "intensities": "intensity",
    "spacings": "spacing",
    "return_ids": "return_id",
    "return_counts": "return_count",
}
# What else files and Blender's points have a name for.
_OTHERS = (
    "object_names",
    "material_names",
    "ray_count",
    "pose_error",
    "scene_error",
    "labels",
    "normal",
    "position",
    "radius",
    "color",
)


@dataclass(frozen=True, slots=True)
class PointCloud:
    """N points where rays met something, in the order in which the rays were cast; misses are left out.

    positions: (N, 3) float64, world space. distances: (N,) float64 from the sensor, in world units.
    normals: (N, 3) float32, unit, of the triangle's plane, by its winding.
    object_ids: (N,) int32, rows of object_names. material_ids: (N,) int32, rows of material_names, -1 for none.
    instance_ids: (N,) int32: what is shown several times has a number for each; it lasts through a scan, no longer.
    times: (N,) float64, seconds since the scan began. ray_ids: (N,) int64: which ray, counted over the whole scan.
    ring_ids: (N,) int32: the line of a LiDAR, in the order of its elevations, or the row of a camera's picture.
    incidences: (N,) float32, cosine of the angle between ray and normal: 1 straight on, 0 grazing.
    intensities: (N,) float32, what comes back of a diffuse surface, whatever the distance: the luminance of the
    material's viewport colour times the incidence. With a sensor's light: what the sensor receives, 1 for white that
    fills the beam, met straight on, at `Optics.reference` (or, if calibrated, at any distance); more for what mirrors.
    Then normals, ids and incidences are of what gave back the most of an echo, as it was met; distances how far the
    light went, as measured; and positions lie so far along the ray, also where a mirror had bent its way.
    spacings: (N,) float32, how far neighbouring rays are apart there.
    return_ids, return_counts: (N,) int32, which echo of its ray's beam a point is, from 0, the nearest first, and how
    many of the beam were kept: 0 and 1 without light.
    labels: further columns by the names that were asked for: custom properties, collections and others, see `scan`.
    ray_count: how many were cast. ray_outcomes: what became of them, a `RayCounts`, whose counts add up to ray_count in
    every cloud of a scan. warnings: what could not be read or followed, and why a scan is of no use, as sentences.

    pose_error, scene_error: in world units, what the straight ways between the key moments of a LiDAR's frames leave
    of curved ones: about how far points may be off since the sensor, and since what it met, was not quite there. Each
    is an eighth of the largest second difference of three key moments in a row (of turns, how far they are from even
    ones): of the sensor's poses, at the farthest point; of the corners of the boxes of all instances that moved, and of
    vertices that deformed, whether they were met or not. More steps per frame make both less. They are estimates, no
    bounds: what swings to and fro within a stretch, or turns by more than half of one, does not show at its ends;
    nothing is known of a single stretch; and what could not be followed, which `warnings` name, does not count. What
    changes its speed at a key moment alone counts, although it is followed. Where rays graze a surface, points are off
    by more than it is. 0 for what is scanned at single moments.
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
    ray_outcomes: RayCounts = field(default_factory=RayCounts)

    def __len__(self) -> int:
        return len(self.positions)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes everything into an .npz file (the ending is added if it is missing) and returns its path.

        A file of that name is replaced once the new one is complete: a failure leaves it as it was. Raises OSError with
        the reason if it cannot be written.
        """
        path = Path(path)
        if path.suffix.lower() != ".npz":
            path = path.with_name(path.name + ".npz")
        with replacing(path) as name:
            self.write_npz(name)
        return path

    def described_labels(self, columns: Mapping[str, str]) -> dict[str, Any]:
        """What the values of labels are, as JSON has it. columns: what each label is called in the file."""
        return {name: {"column": columns[name], **label.table.described()} for name, label in self.labels.items()}

    def write_npz(self, path: Path) -> None:
        """Into an open place, as it is: `save` is what keeps the file before.

        Labels have the names of `column_names`; what their values are stands in `labels`, as JSON.
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
        arrays |= {names[name]: label.values for name, label in self.labels.items()}
        write_arrays(path, arrays)


def column_names(labels: Iterable[str]) -> dict[str, str]:
    """What the column of each label is called: the label's own name, or `label_NAME` if that is taken."""
    taken = {*COLUMNS, *SINGULAR.values(), *_OTHERS, *(name for names in AXES.values() for name in names)}
    # Readers of some formats do not tell small letters from capitals.
    return {name: f"label_{name}" if name.lower() in taken else name for name in labels}
