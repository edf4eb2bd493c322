"""Frames of a drive as messages of ROS 2, in a bag of MCAP files. Does not depend on Blender.

Points are as LiDARs' drivers publish them: in the sensor's axes at each point's own time (x ahead, y to the left, z
up), with `time` in seconds after the message's stamp. A bag's first stamp is 1 s: in ROS, 0 means the latest.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from io import StringIO
from pathlib import Path
from shutil import copyfile
from typing import Any

import numpy as np
import numpy.typing as npt

from ..support.files import replacing

POINTS, IMAGE, CAMERA_INFO, POSES = "/points", "/camera/image_raw", "/camera/camera_info", "/tf"
WORLD, SENSOR, CAMERA = "map", "lidar", "camera"  # frames of coordinates
BEGIN = 1.0  # seconds: the stamp of a scan's beginning
VERSION = 8  # of the metadata: the last that all releases of ROS 2 from Humble on read
POINT = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2"), ("time", "<f4")], align=False
)
_FIELD_TYPES = {"<f4": 7, "<u2": 4}  # as PointField numbers them
METADATA = "metadata.yaml"
INFORMATION = "rosbag2_bagfile_information"

Doubles = npt.NDArray[np.float64]


class Bag:
    """Gathers messages, and writes them as one MCAP file. Times are seconds since the scan began."""

    def __init__(self) -> None:
        from rosbags.typesys import Stores, get_typestore

        self._store = get_typestore(Stores.ROS2_HUMBLE)
        self._messages: list[tuple[int, str, Any]] = []

    def add_points(
        self,
        seconds: float,
        positions: Doubles,
        intensities: npt.NDArray[Any],
        rings: npt.NDArray[Any],
        times: npt.NDArray[Any],
    ) -> None:
        """Add points: (N, 3) positions in the sensor's axes, and (N,) of each other column; times: after `seconds`."""
        points = np.empty(len(positions), POINT)
        for name, column in zip(POINT.names or (), (*positions.T, intensities, rings, times), strict=True):
            points[name] = column
        fields = [
            self._make("sensor_msgs/msg/PointField", name, offset, _FIELD_TYPES[kind.str], 1)
            for name, (kind, offset) in (POINT.fields or {}).items()
        ]
        data = np.frombuffer(points.tobytes(), np.uint8)
        values = 1, len(points), fields, False, POINT.itemsize, points.nbytes, data, True
        self._add(seconds, POINTS, SENSOR, "sensor_msgs/msg/PointCloud2", *values)

    def add_image(
        self, seconds: float, pixels: npt.NDArray[np.uint8], intrinsics: Sequence[Sequence[float]] | None
    ) -> None:
        """Add an image, (H, W, 3) uint8, and its camera. intrinsics: (3, 3), None if the camera has none."""
        size = pixels.shape[:2]
        values: tuple[Any, ...] = "rgb8", 0, 3 * size[1], pixels.reshape(-1)
        self._add(seconds, IMAGE, CAMERA, "sensor_msgs/msg/Image", *size, *values)
        if intrinsics is not None:
            matrix = np.array(intrinsics)
            projection = np.column_stack([matrix, np.zeros(3)])
            whole = self._make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
            values = "plumb_bob", np.zeros(5), matrix.ravel(), np.eye(3).ravel(), projection.ravel(), 0, 0, whole
            self._add(seconds, CAMERA_INFO, CAMERA, "sensor_msgs/msg/CameraInfo", *size, *values)

    def add_pose(self, seconds: float, child: str, pose: Doubles) -> None:
        """Add where the sensor or the camera is. pose: (4, 4), from its axes to the world."""
        translation = self._make("geometry_msgs/msg/Vector3", *pose[:3, 3].tolist())
        rotation = self._make("geometry_msgs/msg/Quaternion", *quaternion(pose[:3, :3]))
        transform = self._make("geometry_msgs/msg/Transform", translation, rotation)
        stamped = self._make("geometry_msgs/msg/TransformStamped", self._header(seconds, WORLD), child, transform)
        self._messages.append((_nanoseconds(seconds), POSES, self._make("tf2_msgs/msg/TFMessage", [stamped])))

    def save(self, path: Path) -> dict[str, Any]:
        """Write the file; an older one is replaced once it is complete.

        Returns:
            Its metadata, for `join`.

        Raises:
            OSError.
        """
        from rosbags.rosbag2 import StoragePlugin, Writer
        from ruamel.yaml import YAML

        with tempfile.TemporaryDirectory() as folder:
            made = Path(folder, path.stem)
            with Writer(made, version=VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
                topics: dict[str, Any] = {}
                for nanoseconds, topic, message in sorted(self._messages, key=lambda each: each[0]):
                    kind = message.__msgtype__
                    if topic not in topics:
                        topics[topic] = writer.add_connection(topic, kind, typestore=self._store)
                    writer.write(topics[topic], nanoseconds, self._store.serialize_cdr(message, kind))
            with replacing(path) as name:
                copyfile(made / path.name, name)
            metadata: dict[str, Any] = YAML(typ="safe").load((made / METADATA).read_text(encoding="utf-8"))
        return metadata[INFORMATION]

    def _add(self, seconds: float, topic: str, frame: str, kind: str, *values: Any) -> None:
        message = self._make(kind, self._header(seconds, frame), *values)
        self._messages.append((_nanoseconds(seconds), topic, message))

    def _header(self, seconds: float, frame: str) -> Any:
        stamp = self._make("builtin_interfaces/msg/Time", *divmod(_nanoseconds(seconds), 10**9))
        return self._make("std_msgs/msg/Header", stamp, frame)

    def _make(self, kind: str, *values: Any) -> Any:
        """Make a message. values: in the order of its definition."""
        return self._store.types[kind](*values)


def _nanoseconds(seconds: float) -> int:
    return round((BEGIN + seconds) * 1e9)


def quaternion(turn: Doubles) -> tuple[float, float, float, float]:
    """(x, y, z, w) of a rotation, (3, 3), as Bar-Itzhack finds it: an eigenvector."""
    (a, b, c), (d, e, f), (g, h, i) = turn.tolist()
    rows = [[a - e - i, d + b, g + c, h - f], [d + b, e - a - i, h + f, c - g], [g + c, h + f, i - a - e, d - b]]
    x, y, z, w = np.linalg.eigh(np.array([*rows, [h - f, c - g, d - b, a + e + i]]))[1][:, 3].tolist()
    sign = -1.0 if w < 0.0 else 1.0
    return sign * x, sign * y, sign * z, sign * w


def join(folder: Path, parts: Sequence[dict[str, Any]]) -> None:
    """Write the metadata that make these files one bag. parts: from `Bag.save`, in order. Raises OSError."""
    from ruamel.yaml import YAML

    starts = [part["starting_time"]["nanoseconds_since_epoch"] for part in parts]
    ends = [start + part["duration"]["nanoseconds"] for start, part in zip(starts, parts, strict=True)]
    topics: dict[str, dict[str, Any]] = {}
    for part in parts:
        for topic in part["topics_with_message_count"]:
            known = topics.setdefault(topic["topic_metadata"]["name"], {**topic, "message_count": 0})
            known["message_count"] += topic["message_count"]
    whole = {
        **parts[0],
        "relative_file_paths": [name for part in parts for name in part["relative_file_paths"]],
        "files": [file for part in parts for file in part["files"]],
        "starting_time": {"nanoseconds_since_epoch": min(starts)},
        "duration": {"nanoseconds": max(ends) - min(starts)},
        "message_count": sum(part["message_count"] for part in parts),
        "topics_with_message_count": list(topics.values()),
    }
    text = StringIO()
    yaml = YAML(typ="safe")
    yaml.default_flow_style = False
    yaml.dump({INFORMATION: whole}, text)
    with replacing(folder / METADATA) as name:
        name.write_text(text.getvalue(), encoding="utf-8")
