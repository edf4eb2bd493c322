"""What the columns of labels are called in each format of point clouds. Knows no Blender."""

from __future__ import annotations

import re
from collections.abc import Iterable

from .point_cloud import column_names

# What no name may hold, and how many bytes it may have.
_FORBIDDEN = {".ply": r"[^!-~]", ".las": r"[\0]", ".h5": r"[/\0]"}
_MOST_BYTES = {".las": 32}
# Of LAS's own columns.
_TAKEN = {
    ".las": frozenset(
        (
            "return_number",
            "number_of_returns",
            "synthetic",
            "key_point",
            "withheld",
            "overlap",
            "scanner_channel",
            "scan_direction_flag",
            "edge_of_flight_line",
            "classification",
            "user_data",
            "scan_angle",
            "point_source_id",
            "gps_time",
        )
    )
}


def label_columns(labels: Iterable[str], suffix: str) -> dict[str, str]:
    """The column of each label in a file of a format, by the label's name.

    labels: their names. A column is called as its label, or `label_NAME` if the file has a column of that name. PLY's
    names have ASCII characters without spaces, HDF5's no slash (others become `_`), and LAS's end after 32 bytes.
    Raises ValueError where two labels would have one column.
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
