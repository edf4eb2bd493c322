"""Images of labels as PNG files of 16 bits of grey. Knows no Blender.

Depth as BOP and KITTI keep it: whole steps of a scale, 0 where there is nothing. Ids are rows and numbers + 1, 0 for
nothing. The format is PNG's second edition (W3C 2003): the bytes are as they are, so that no reader's colours matter.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..sync.label_columns import LabelColumn
from .labels import Labels

Uint16Array = npt.NDArray[np.uint16]
MOST = 65535
NOTHING_IN_SIGHT = 1e9  # depths beyond are of rays that met nothing


def grey_images(labels: Labels, depth_scale: float, plain: Mapping[str, str]) -> tuple[dict[str, Uint16Array], int]:
    """Images by their names, (H, W), and how many pixels of all depths are too far away for 16 bits.

    depth_scale: world units a step. plain: what labels are called. Raises ValueError for ids above 65,534, and for
    labels below 0 or with fractions.
    """
    ids = {"things": labels.thing_ids, "categories": labels.category_ids, "materials": labels.material_ids}
    images = {name: _ids(name, values) for name, values in ids.items()}
    for name, label in labels.labels.items():
        images[f"label_{plain[name]}"] = _label(name, label)
    depths = {"depth": labels.depth}
    if len(labels.layer_depths) > 1:
        for number, (depth, things) in enumerate(zip(labels.layer_depths, labels.layer_ids, strict=True), start=1):
            depths[f"depth_layer_{number}"] = depth
            images[f"things_layer_{number}"] = _ids("things", things)
    too_far = 0
    for name, depth in depths.items():
        steps = np.maximum(np.rint(depth.astype(np.float64) / depth_scale), 1.0)
        is_there = depth < NOTHING_IN_SIGHT
        is_near = is_there & (steps <= MOST)
        too_far += int((is_there & ~is_near).sum())
        images[name] = np.where(is_near, steps, 0.0).astype(np.uint16)
    return images, too_far


def _label(name: str, label: LabelColumn) -> Uint16Array:
    if not label.table.is_whole:
        raise ValueError(f"png: label {name!r} has fractions: choose exr, npy or npz, or leave it out")
    is_there = label.values != label.table.missing
    lowest = int(label.values.min(where=is_there, initial=0))
    if lowest < 0:
        raise ValueError(f"png: label {name!r} has the value {lowest}, and 0 is nothing: choose exr, npy or npz")
    return _ids(f"label {name!r}", np.where(is_there, label.values, -1))


def _ids(name: str, values: npt.NDArray[np.int32]) -> Uint16Array:
    highest = int(values.max(initial=-1))
    if highest >= MOST:
        raise ValueError(
            f"png: numbers of {name} go up to {highest:,}, and 16 bits hold {MOST - 1:,}: choose exr, npy or npz"
        )
    return (values + 1).astype(np.uint16)


def write_grey(path: Path, image: Uint16Array) -> None:
    """Writes (H, W), row 0 on top. Raises OSError."""
    height, width = image.shape
    rows = np.zeros((height, 1 + 2 * width), np.uint8)  # each begins with its filter: none
    rows[:, 1:] = image.astype(">u2").view(np.uint8).reshape(height, 2 * width)
    header = struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 1)), (b"IEND", b""))
    with path.open("wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        for kind, content in parts:
            file.write(struct.pack(">I", len(content)) + kind + content)
            file.write(struct.pack(">I", zlib.crc32(kind + content)))
