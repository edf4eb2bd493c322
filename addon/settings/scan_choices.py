"""What scans offer to choose from: formats of files, colors of points, sensors. Imports neither Blender nor numpy.

So the command line can list them at once. Numbers of items are what .blend files keep.
"""

from __future__ import annotations

import re
import tomllib
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

# Formats of files of points, and the libraries that they need.


@dataclass(frozen=True, slots=True)
class CloudFormat:
    """A format of files of points.

    name: the ending without its dot. modules: of Python, that writing it imports. extra: of the package, that has them.
    has_boxes: whether its files may have boxes. is_drive: whether it has the camera's images, and no columns of labels.
    """

    name: str
    label: str
    description: str
    modules: tuple[str, ...] = ()
    extra: str = "data"
    has_boxes: bool = False
    is_drive: bool = False


CLOUD_FORMATS = (
    CloudFormat("npz", "NumPy", "NumPy archive (.npz) with all columns and names", has_boxes=True),
    CloudFormat("ply", "PLY", "Binary polygon file (.ply) with all columns"),
    CloudFormat("las", "LAS", "LAS 1.4, the exchange format of surveyors"),
    CloudFormat(
        "laz", "LAZ", "Compressed LAS. Needs the libraries laspy and lazrs; LAS needs none", ("laspy", "lazrs")
    ),
    CloudFormat("csv", "CSV", "Text table with commas"),
    CloudFormat(
        "parquet", "Parquet", "Compressed table. Needs the library pyarrow", ("pyarrow.parquet",), has_boxes=True
    ),
    CloudFormat("h5", "HDF5", "One array per column. Needs the library h5py", ("h5py",), has_boxes=True),
    CloudFormat("kitti", "KITTI", "Points, images and 3D boxes of each frame, as KITTI has them", is_drive=True),
    CloudFormat(
        "mcap",
        "ROS 2 Bag",
        "Points, images and poses of each frame as a bag of ROS 2. Needs the library rosbags",
        ("rosbags.rosbag2", "rosbags.typesys"),
        extra="ros",
        is_drive=True,
    ),
)
FORMATS = {f".{one.name}": one for one in CLOUD_FORMATS}
KITTI, MCAP = ".kitti", ".mcap"


# Point color items ---------------------------------------------------------------------------------------------------
# What colors of a scan's points can mean, as the items of a menu.


OTHER = "COLUMN"


class PointColor(NamedTuple):
    """An item. column: the points' attribute that is shown. scale: how its values become colors.

    scale is "near" (even ratios along a ramp, yellow to violet), "ramp" (even steps along it), "ids" (a color for
    each), "grey" (black to white), "normal" (directions as red, green and blue), or "height" (the ramp, of the third
    number).
    """

    identifier: str
    label: str
    description: str
    number: int
    column: str
    scale: str


POINT_COLORS = (
    PointColor("DISTANCE", "Distance", "Distance from the sensor: yellow near, violet far", 0, "distance", "near"),
    PointColor("HEIGHT", "Height", "Height of the point: yellow low, violet high", 3, "position", "height"),
    PointColor("OBJECT", "Object", "The object that was hit", 1, "object_id", "ids"),
    PointColor(
        "INSTANCE", "Instance", "The instance that was hit, where an object has several", 4, "instance_id", "ids"
    ),
    PointColor("MATERIAL", "Material", "The material that was hit; grey without a material", 5, "material_id", "ids"),
    PointColor(
        "INTENSITY",
        "Intensity",
        "How much light comes back; without a sensor's light that of the material's viewport color",
        2,
        "intensity",
        "grey",
    ),
    PointColor(
        "INCIDENCE",
        "Incidence",
        "Angle between ray and surface: yellow grazing, violet head on",
        6,
        "incidence",
        "ramp",
    ),
    PointColor(
        "NORMAL", "Normal", "Direction of the surface normal: X as red, Y as green, Z as blue", 7, "normal", "normal"
    ),
    PointColor("TIME", "Time", "Time of the ray: yellow first, violet last", 8, "time", "ramp"),
    PointColor("RING", "Ring", "Line of a LiDAR, or row of a picture: yellow the first", 9, "ring", "ramp"),
    PointColor("RETURN", "Return", "Number of the echo within its beam, one color each", 11, "return_id", "ids"),
    PointColor("RETURNS", "Returns", "Number of echoes of the beam that were kept", 12, "return_count", "ids"),
)


def items() -> list[tuple[str, str, str, int]]:
    """Returns the items of a property. The last one is for columns that a scan was requested for by name."""
    found = [(color.identifier, color.label, color.description, color.number) for color in POINT_COLORS]
    return [*found, (OTHER, "Other Column", "Any attribute of the points, by its name", 10)]


def find_color(identifier: str) -> PointColor:
    """The item of that identifier, which is not OTHER."""
    return next(color for color in POINT_COLORS if color.identifier == identifier)


# Sensor items --------------------------------------------------------------------------------------------------------
# Files of sensors, and those that the add-on brings as the items of a menu.
#
# What files say of rays is understood by `scanning/sensor_files.py`.


FOLDER = Path(__file__).parents[1] / "scanning" / "sensors"
SUFFIX = ".toml"
SMALL_WORDS = ("a", "and", "in", "of", "on", "or", "the", "to")  # in names of Blender's

Item = tuple[str, str, str, int]


def sensor_names() -> tuple[str, ...]:
    """Returns the add-on's sensors, in the order of their names; numbers in them count as numbers."""

    def parts(name: str) -> list[tuple[int, str]]:
        return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]

    return tuple(sorted((path.stem for path in FOLDER.glob(f"*{SUFFIX}")), key=parts))


def read_sensor_file(path: Path) -> dict[str, Any]:
    """Reads a file's contents by its words. Raises ValueError for invalid TOML, OSError if it cannot be read."""
    try:
        with path.open("rb") as file:
            return tomllib.load(file)
    except ValueError as error:  # of TOML or of UTF-8
        raise ValueError(f"sensor: {path}: {error}") from error


def number_of(name: str) -> int:
    """Returns a sensor's number in .blend files. It depends only on its name, so other sensors do not change it."""
    return zlib.crc32(name.encode()) & 0x7FFF_FFFF


def sensor_items() -> list[Item]:
    """Identifier (the sensor's name), title, where its numbers are from, and number, in the order of the names."""
    items = []
    for name in sensor_names():
        values = read_sensor_file(FOLDER / f"{name}{SUFFIX}")
        items.append((name, _as_name(values["title"]), _capital(values["source"]), number_of(name)))
    return items


def _as_name(title: str) -> str:
    return _capital(" ".join(word if word in SMALL_WORDS else _capital(word) for word in title.split()))


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
