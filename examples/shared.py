"""What the examples share: their two arguments, meshes of numpy arrays, and pictures of arrays."""

from __future__ import annotations

import struct
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np

SCENES = Path(__file__).resolve().parent.parent / "blend_scenes"
RAMP = np.array([(68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37)]) / 255  # viridis
Array = np.ndarray[Any, Any]


def read_arguments(width: int = 640) -> tuple[Path, int]:
    """Read `[FOLDER [WIDTH]]` and return the folder, which is created, and the width of pictures in pixels."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    return folder, int(sys.argv[2]) if len(sys.argv) > 2 else width


def make_hills(size: int) -> tuple[Array, Array]:
    """Return (V, 3) positions and (T, 3) triangles of hills over -10 to 10, size x size vertices."""
    x, y = np.meshgrid(*[np.linspace(-10, 10, size)] * 2, indexing="ij")
    corners = np.arange(size * size).reshape(size, size)
    a, b, c, d = corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]
    triangles = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return np.stack([x, y, np.sin(x) * np.cos(0.7 * y)], axis=-1).reshape(-1, 3), triangles


def to_colors(values: Array, least: float | None = None, most: float | None = None) -> Array:
    """Return (..., 3) colors of numbers, from violet to yellow; what is not finite is black."""
    is_known = np.isfinite(values)
    known = values[is_known] if is_known.any() else np.zeros(1)
    least, most = known.min() if least is None else least, known.max() if most is None else most
    shares = (np.where(is_known, values, least) - least) / max(most - least, 1e-12) * (len(RAMP) - 1)
    colors = np.stack([np.interp(shares, range(len(RAMP)), channel) for channel in RAMP.T], axis=-1)
    return colors * is_known[..., None]


def id_colors(ids: Array) -> Array:
    """Return (..., 3) colors of ids, different ones for neighbours; -1 is black."""
    hues = np.asarray(ids)[..., None] * 0.618034 + np.array([0, 1 / 3, 2 / 3])
    return (0.55 + 0.4 * np.cos(2 * np.pi * hues)) * (np.asarray(ids) >= 0)[..., None]


def save_png(path: Path, image: Array) -> None:
    """Write an (H, W, 3) image of colors from 0 to 1 as a PNG file, row 0 on top, and print its path."""
    pixels = (np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8)
    height, width, _ = pixels.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1).tobytes()
    data = b"\x89PNG\r\n\x1a\n"
    for kind, content in (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(rows)),
        (b"IEND", b""),
    ):
        data += struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
    path.write_bytes(data)
    print(path)
