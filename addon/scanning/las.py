"""Writes LAS 1.4 files of point format 6 (ASPRS LAS specification 1.4 R15). Needs neither Blender nor a library.

The same points give the same bytes: the creation date in the header is fixed.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

SOFTWARE = b"Perfect BVH"
YEAR = 2000
MOST_BYTES_IN_A_RECORD = 65_535  # a longer text continues in the next record of the same description
MOST_RETURNS = 15  # four bits

_HEADER = struct.Struct("<4sHH16sBB32s32sHHHIIBHI5I12dQQIQ15Q")
_RECORD = struct.Struct("<H16sHH32s")
_EXTRA_BYTES = struct.Struct("<2xBB32s124x32s")
_USES_WKT = 0x10  # which formats 6 to 10 require; times count as those of a week
_POINT = [
    ("xyz", "<i4", 3),
    ("intensity", "<u2"),
    ("returns", "u1"),
    ("flags", "u1"),
    ("classification", "u1"),
    ("user_data", "u1"),
    ("scan_angle", "<i2"),
    ("point_source_id", "<u2"),
    ("gps_time", "<f8"),
]
# Codes of extra dimensions (table 24 of the specification).
_CODES = {"u1": 1, "i1": 2, "u2": 3, "i2": 4, "u4": 5, "i4": 6, "u8": 7, "i8": 8, "f4": 9, "f8": 10}


@dataclass(frozen=True, slots=True)
class LasPoints:
    """The columns of the point format itself; all have N rows.

    positions: (N, 3) float64. offsets, scales: (3,) float64; coordinates are stored as whole numbers of `scales`
    beyond `offsets`, and must fit into 32 bits. times: (N,) float64. intensities: (N,) from 0 to 1. return_numbers,
    return_counts: (N,) from 1 to 15; larger ones are stored as 15.
    """

    positions: npt.NDArray[np.float64]
    offsets: npt.NDArray[np.float64]
    scales: npt.NDArray[np.float64]
    times: npt.NDArray[np.float64]
    intensities: npt.NDArray[np.floating[Any]]
    return_numbers: npt.NDArray[np.integer[Any]]
    return_counts: npt.NDArray[np.integer[Any]]


def write_las(
    file: BinaryIO, points: LasPoints, extra: Mapping[str, npt.NDArray[Any]], texts: Mapping[str, str]
) -> None:
    """Writes one file.

    Args:
        file: Open for binary writing.
        points: The columns of the point format.
        extra: Further columns by name, (N,) of whole numbers or floats; a name has at most 32 bytes.
        texts: Variable-length records with the user id "Perfect BVH"; the key is the description.
    """
    columns = {name: np.ascontiguousarray(values) for name, values in extra.items()}
    rows = _rows(points, columns)
    records = [_extra_bytes_record(columns)] if columns else []
    records += _text_records(texts)
    file.write(_header(points, rows, records))
    for record in records:
        file.write(record)
    file.write(rows.tobytes())


def _rows(points: LasPoints, extra: Mapping[str, npt.NDArray[Any]]) -> npt.NDArray[Any]:
    kinds = [(f"extra {name}", values.dtype.newbyteorder("<")) for name, values in extra.items()]
    rows = np.zeros(len(points.positions), np.dtype([*_POINT, *kinds]))
    rows["xyz"] = np.round((points.positions - points.offsets) / points.scales)
    rows["intensity"] = np.round(np.clip(points.intensities, 0.0, 1.0) * 65535.0)
    numbers, counts = (np.minimum(each, MOST_RETURNS) for each in (points.return_numbers, points.return_counts))
    rows["returns"] = numbers | counts << 4
    rows["gps_time"] = points.times
    for name, values in extra.items():
        rows[f"extra {name}"] = values
    return rows


def _header(points: LasPoints, rows: npt.NDArray[Any], records: Sequence[bytes]) -> bytes:
    whole = rows["xyz"]
    bounds = np.zeros((3, 2))  # by axis: largest, smallest
    if len(rows):
        bounds[:, 0] = whole.max(axis=0) * points.scales + points.offsets
        bounds[:, 1] = whole.min(axis=0) * points.scales + points.offsets
    by_return = np.bincount(rows["returns"] & MOST_RETURNS, minlength=MOST_RETURNS + 1)[1:]
    return _HEADER.pack(
        b"LASF",
        *(0, _USES_WKT, bytes(16), 1, 4, b"", SOFTWARE, 1, YEAR),
        *(_HEADER.size, _HEADER.size + sum(map(len, records)), len(records)),
        *(6, rows.dtype.itemsize, 0, 0, 0, 0, 0, 0),  # the numbers of points of older versions stay 0
        *(*points.scales, *points.offsets, *bounds.ravel()),
        *(0, 0, 0, len(rows), *(int(count) for count in by_return)),
    )


def _record(user: bytes, number: int, description: bytes, content: bytes) -> bytes:
    return _RECORD.pack(0, user, number, len(content), description) + content


def _extra_bytes_record(extra: Mapping[str, npt.NDArray[Any]]) -> bytes:
    described = (
        _EXTRA_BYTES.pack(_CODES[values.dtype.str[1:]], 0, name.encode(), b"") for name, values in extra.items()
    )
    return _record(b"LASF_Spec", 4, b"Extra Bytes Record", b"".join(described))


def _text_records(texts: Mapping[str, str]) -> list[bytes]:
    step, records = MOST_BYTES_IN_A_RECORD, []
    for name, text in texts.items():
        whole = text.encode()
        starts = range(0, max(len(whole), 1), step)
        records += [_record(SOFTWARE, n, name.encode(), whole[at : at + step]) for n, at in enumerate(starts)]
    return records
