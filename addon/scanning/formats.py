"""Writes point clouds to files that other programs read. Needs no Blender.

The suffix of the file name chooses the format. .npz, .ply, .las and .csv need no library; .laz, .parquet and .h5 need
those of `pip install 'perfect-bvh[data]'`. The names of objects, materials and labels are stored with the columns
where a format has a place for them.
"""

from __future__ import annotations

import csv
import io
import json
import os
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from ..settings.scan_choices import FORMATS, KITTI
from ..support.files import data_library, replacing
from .las import LasPoints, write_las
from .point_cloud import AXES, COLUMNS, PointCloud, column_names

# The names of label columns in each format of point clouds.


# What no name may hold, and how many bytes it may have.
_FORBIDDEN = {".ply": r"[^!-~]", ".las": r"[\0]", ".h5": r"[/\0]"}
_MOST_BYTES = {".las": 32}
# Of LAS's own columns.
_TAKEN = {
    ".las": (
        *("return_number", "number_of_returns", "synthetic", "key_point", "withheld", "overlap", "scanner_channel"),
        *("scan_direction_flag", "edge_of_flight_line", "classification", "user_data", "scan_angle"),
        *("point_source_id", "gps_time"),
    )
}


def label_columns(labels: Iterable[str], suffix: str) -> dict[str, str]:
    """The column of each label in a file of a format, by the label's name.

    Args:
        labels: Their names. A column is called as its label, or `label_NAME` if the file has a column of that name.
            PLY's names have ASCII characters without spaces, HDF5's no slash (others become `_`), and LAS's end after
            32 bytes.

    Raises:
        ValueError: Where two labels would have one column.
    """
    found = {}
    for name, column in column_names(labels).items():
        column = f"label_{column}" if column.lower() in _TAKEN.get(suffix, ()) else column
        column = re.sub(_FORBIDDEN.get(suffix, r"\0"), "_", column)
        found[name] = column.encode()[: _MOST_BYTES.get(suffix)].decode(errors="ignore")
    for name, column in found.items():
        other = next(each for each in found if found[each] == column)
        if other != name:
            raise ValueError(f"labels {other!r} and {name!r} would both be column {column!r} of a {suffix[1:]} file")
    return found


# Formats -------------------------------------------------------------------------------------------------------------


LAS_STEP = 1e-4  # of coordinates, in world units: LAS keeps them as whole numbers
MOST_LAS_STEPS = 2**31 - 1
CSV_ROWS = 65_536  # that are text at a time
PLY_TYPES = {
    "i1": "char",
    "u1": "uchar",
    "i2": "short",
    "u2": "ushort",
    "i4": "int",
    "u4": "uint",
    "f4": "float",
    "f8": "double",
}
Float64Array = npt.NDArray[np.float64]


def save_cloud(cloud: PointCloud, path: str | os.PathLike[str]) -> Path:
    """Writes a cloud in the format of the path's ending; a file of that name is replaced once the new one is complete.

    LAS and LAZ keep positions in steps of 1/10,000 of a world unit, or of 2^-32 of an axis' extent if that is longer
    than 429,000 units. Boxes are in .npz, .parquet and .h5 alone.

    Raises:
        ValueError: For another ending, and if positions or intensities that LAS would round to whole numbers are not
            finite; ImportError with what to install; OSError.
    """
    path = Path(path)
    write = WRITERS.get(path.suffix.lower())
    if write is None:
        raise ValueError(f"save_cloud: the name must end in {', '.join(WRITERS)}, got {path.name!r}")
    with replacing(path) as name:
        write(cloud, name)
    return path


def check_format(
    suffix: str, labels: Iterable[str] = (), *, boxes: bool = False, category: str | None = None, steps: int = 1
) -> None:
    """Raises ValueError for a format that there is not, ImportError with what to install for one that needs more.

    Args:
        labels: By their names; ValueError, too, if the format has no columns for all of them.
        boxes, category, steps: ValueError if the format has no boxes, no categories, or a single time sample a frame.
    """
    if suffix not in FORMATS:
        raise ValueError(
            f"the format must be one of {', '.join(one.name for one in FORMATS.values())}, got {suffix[1:]!r}"
        )
    chosen = FORMATS[suffix]
    for module in chosen.modules:
        _library(module)
    having = ", ".join(one.name for one in FORMATS.values() if one.has_boxes)
    for is_refused, reason in (
        (boxes and not chosen.has_boxes, f"has no table of boxes: leave them out, or write one of {having}"),
        (any(labels) and chosen.is_drive, "has no columns for labels: leave them out, or write npz"),
        (category is not None and suffix != KITTI, "has no categories: leave the category out, or write kitti"),
        (steps > 1 and suffix == KITTI, "has one moment for each frame: leave out the steps, or write mcap"),
    ):
        if is_refused:
            raise ValueError(f"{suffix[1:]} {reason}")
    label_columns(labels, suffix)


def _library(name: str) -> Any:
    chosen = next((one for one in FORMATS.values() if name in one.modules), None)
    modules, extra = ((name,), "data") if chosen is None else (chosen.modules, chosen.extra)
    packages = dict.fromkeys(module.partition(".")[0] for module in modules)
    return data_library(name, f"this format needs {' and '.join(packages)} (perfect-bvh[{extra}])", packages)


def _table(cloud: PointCloud, labels: Mapping[str, str]) -> dict[str, npt.NDArray[Any]]:
    """A column for each component of each vector, in the order of `COLUMNS`, then the labels. labels: their columns."""
    table: dict[str, npt.NDArray[Any]] = {}
    for column in COLUMNS:
        values = getattr(cloud, column)
        if column in AXES:
            table |= {name: np.ascontiguousarray(values[:, axis]) for axis, name in enumerate(AXES[column])}
        else:
            table[COLUMNS[column].singular] = values
    return table | {labels[name]: label.values for name, label in cloud.labels.items()}


def _facts(cloud: PointCloud, labels: Mapping[str, str]) -> dict[str, str]:
    """Returns facts about the whole cloud, as text."""
    return {
        "object_names": json.dumps(cloud.object_names),
        "material_names": json.dumps(cloud.material_names),
        "ray_count": str(cloud.ray_count),
        "pose_error": repr(cloud.pose_error),
        "scene_error": repr(cloud.scene_error),
        "labels": json.dumps(cloud.described_labels(labels)),
    }


def _npz(cloud: PointCloud, path: Path) -> None:
    cloud.write_npz(path)


def _ply(cloud: PointCloud, path: Path) -> None:
    labels = label_columns(cloud.labels, ".ply")
    table = _table(cloud, labels)
    table["ray_id"] = table["ray_id"].astype(np.float64)  # PLY has no whole numbers of 64 bits
    rows = np.empty(len(cloud), [(name, values.dtype.newbyteorder("<")) for name, values in table.items()])
    for name, values in table.items():
        rows[name] = values
    lines = ["ply", "format binary_little_endian 1.0"]
    lines += [f"comment {name} {text}" for name, text in _facts(cloud, labels).items()]
    lines += [f"element vertex {len(rows)}"]
    lines += [f"property {PLY_TYPES[values.dtype.str[1:]]} {name}" for name, values in table.items()]
    with path.open("wb") as file:
        file.write("\n".join([*lines, "end_header", ""]).encode("ascii"))
        file.write(rows.tobytes())


def _las(cloud: PointCloud, path: Path) -> None:
    with path.open("wb") as file:
        _write_las(cloud, file)


def _laz(cloud: PointCloud, path: Path) -> None:
    laspy, whole = _library("laspy"), io.BytesIO()
    _write_las(cloud, whole)
    whole.seek(0)
    with path.open("wb") as file:
        laspy.read(whole).write(file, do_compress=True)


def _write_las(cloud: PointCloud, file: BinaryIO) -> None:
    labels = label_columns(cloud.labels, ".las")
    own = {"x", "y", "z", "time", "intensity", "return_id", "return_count"}
    extra = {name: values for name, values in _table(cloud, labels).items() if name not in own}
    numbers, counts = cloud.return_ids + 1, cloud.return_counts
    points = LasPoints(cloud.positions, *_las_steps(cloud), cloud.times, cloud.intensities, numbers, counts)
    write_las(file, points, extra, _facts(cloud, labels))


def _las_steps(cloud: PointCloud) -> tuple[Float64Array, Float64Array]:
    """Returns the offsets and scales, (3,) each, with which every position fits into 32 bits with a sign."""
    is_good = np.isfinite(cloud.positions).all(axis=1) & ~np.isnan(cloud.intensities)
    if not is_good.all():
        raise ValueError(
            f"save_cloud: LAS holds finite positions and intensities alone, but {np.count_nonzero(~is_good):,} of "
            f"{len(cloud):,} points have others; leave those out, or write npz"
        )
    if not len(cloud):
        return np.zeros(3), np.full(3, LAS_STEP)
    low, high = cloud.positions.min(axis=0), cloud.positions.max(axis=0)
    offsets = np.floor(low / 2 + high / 2)  # halves first: the sum of finite numbers may not be finite
    reach = np.maximum(high - offsets, offsets - low)
    return offsets, np.maximum(LAS_STEP, reach / (MOST_LAS_STEPS - 1))  # a step less: the quotient rounds


def _csv(cloud: PointCloud, path: Path) -> None:
    table = _table(cloud, label_columns(cloud.labels, ".csv"))
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        for first in range(0, len(cloud), CSV_ROWS):  # as text they take many times their memory
            writer.writerows(zip(*(_texts(values[first : first + CSV_ROWS]) for values in table.values()), strict=True))


def _texts(values: npt.NDArray[Any]) -> list[Any]:
    """The shortest texts that read back as the same numbers."""
    if values.dtype == np.float32:
        return list(values.astype("U16"))
    return list(values.tolist())


def _parquet(cloud: PointCloud, path: Path) -> None:
    pyarrow, labels = _library("pyarrow"), label_columns(cloud.labels, ".parquet")
    facts = _facts(cloud, labels)
    if cloud.boxes:
        facts["boxes"] = json.dumps({name: column.tolist() for name, column in cloud.boxes.items()})
    table = pyarrow.table(_table(cloud, labels)).replace_schema_metadata(facts)
    _library("pyarrow.parquet").write_table(table, path)


def _hdf5(cloud: PointCloud, path: Path) -> None:
    labels = label_columns(cloud.labels, ".h5")
    with _library("h5py").File(path, "w") as file:
        for name, label in cloud.labels.items():
            file.create_dataset(labels[name], data=label.values)
        file.create_dataset("labels", data=json.dumps(cloud.described_labels(labels)))
        for column in COLUMNS:
            file.create_dataset(column, data=getattr(cloud, column))
        for name, column in cloud.boxes.items():
            file.create_dataset(f"box_{name}", data=column)
        for name in ("object_names", "material_names"):
            file.create_dataset(name, data=[text.encode() for text in getattr(cloud, name)])
        for name in ("ray_count", "pose_error", "scene_error"):
            file.attrs[name] = getattr(cloud, name)


WRITERS: dict[str, Callable[[PointCloud, Path], None]] = {
    ".npz": _npz,
    ".ply": _ply,
    ".las": _las,
    ".laz": _laz,
    ".csv": _csv,
    ".parquet": _parquet,
    ".h5": _hdf5,
}
