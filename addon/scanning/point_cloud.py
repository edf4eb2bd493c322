"""What a scan has measured, as columns, and as a file. Knows no Blender."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..support.arrays import write_arrays
from ..support.files import replacing

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
    ray_count: how many were cast. warnings: what could not be read or followed, as sentences.

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

    def write_npz(self, path: Path) -> None:
        """Into an open place, as it is: `save` is what keeps the file before."""
        arrays = {name: getattr(self, name) for name in COLUMNS} | {
            "object_names": np.array(self.object_names, dtype=np.str_),
            "material_names": np.array(self.material_names, dtype=np.str_),
            "ray_count": np.array(self.ray_count, np.int64),
            "pose_error": np.array(self.pose_error, np.float64),
            "scene_error": np.array(self.scene_error, np.float64),
        }
        write_arrays(path, arrays)
