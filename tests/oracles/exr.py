"""A reader for uncompressed scan-line OpenEXR files, as Blender writes them with codec NONE.

Headless Blender offers no other way to the pixels of a render's passes: `Render Result` is empty there.
The layout is that of "OpenEXR File Layout" (openexr.com): one header of named attributes a part, a table of
offsets a part, then blocks of one scan line each, holding each channel's row in the header's order.
Blender 5 writes one part a pass unless it is asked to interleave them.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import numpy.typing as npt

MAGIC = 20000630
TILED, DEEP, MULTIPART = 0x200, 0x800, 0x1000
SAMPLE_TYPES = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}
Attributes = dict[str, bytes]
Planes = dict[str, npt.NDArray[np.float32]]


def _read_name(data: bytes, position: int) -> tuple[str, int]:
    end = data.index(b"\0", position)
    return data[position:end].decode(), end + 1


def _read_header(data: bytes, position: int) -> tuple[Attributes, int]:
    """One header's attributes by name, empty for the header that ends a list, and where it ends."""
    attributes: Attributes = {}
    while data[position] != 0:
        name, position = _read_name(data, position)
        _, position = _read_name(data, position)
        (size,) = struct.unpack_from("<i", data, position)
        attributes[name] = data[position + 4 : position + 4 + size]
        position += 4 + size
    return attributes, position + 1


def _read_headers(data: bytes, is_multipart: bool) -> tuple[list[Attributes], int]:
    attributes, position = _read_header(data, 8)
    headers = [attributes]
    while is_multipart and attributes:
        attributes, position = _read_header(data, position)
        headers += [attributes] if attributes else []
    return headers, position


def _read_channels(data: bytes) -> list[tuple[str, np.dtype]]:
    channels = []
    position = 0
    while data[position] != 0:
        name, position = _read_name(data, position)
        sample_type, _, step_x, step_y = struct.unpack_from("<iiii", data, position)
        if (step_x, step_y) != (1, 1):
            raise ValueError(f"channel {name} is subsampled")
        channels.append((name, SAMPLE_TYPES[sample_type]))
        position += 16
    return channels


def _read_part(data: bytes, header: Attributes, offsets: tuple[int, ...], block_start: int) -> Planes:
    channels = _read_channels(header["channels"])
    left, top, right, bottom = struct.unpack("<iiii", header["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    planes = {name: np.empty((height, width), np.float32) for name, _ in channels}
    for offset in offsets:
        (row,) = struct.unpack_from("<i", data, offset + block_start)
        position = offset + block_start + 8
        for name, sample_type in channels:
            planes[name][row - top] = np.frombuffer(data, sample_type, width, position)
            position += width * sample_type.itemsize
    return planes


def read_exr(path: Path) -> Planes:
    """Every channel of the file by its full name ("ViewLayer.Depth.Z"), each (H, W) float32, row 0 on top."""
    data = Path(path).read_bytes()
    magic, version = struct.unpack_from("<ii", data, 0)
    if magic != MAGIC or version & (TILED | DEEP):
        raise ValueError(f"{path} is not a scan-line OpenEXR file")
    is_multipart = bool(version & MULTIPART)
    headers, position = _read_headers(data, is_multipart)
    planes: Planes = {}
    for header in headers:
        if header["compression"] != b"\0":
            raise ValueError(f"{path} is compressed; write it with codec NONE")
        _, top, _, bottom = struct.unpack("<iiii", header["dataWindow"])
        height = bottom - top + 1
        offsets = struct.unpack_from(f"<{height}Q", data, position)
        position += 8 * height
        # In a file of several parts each block begins with the number of its part.
        planes |= _read_part(data, header, offsets, 4 if is_multipart else 0)
    return planes
