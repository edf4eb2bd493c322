"""Labels as an OpenEXR file of several layers, as Blender and compositors read them. Knows no Blender.

Channels are named LAYER.PASS.CHANNEL, as Blender names its own: depths, normals, positions, uvs, flow and labels that
are numbers are 32-bit floats, ids are unsigned whole numbers of 32 bits. Compressed without loss (ZIP).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..support.libraries import data_library
from ..sync.label_columns import LabelColumn
from .labels import Labels

LAYER = "Labels"
MOST_EXACT = 1 << 24  # of whole numbers as floats
Channels = dict[str, npt.NDArray[Any]]


def check_exr() -> None:
    """Raises ImportError with what to install."""
    _library()


def _library() -> Any:
    return data_library("OpenEXR", "EXR files need OpenEXR")


def exr_channels(labels: Labels, plain: Mapping[str, str]) -> Channels:
    """(H, W) float32 or uint32, by the channels' names. plain: what labels are called.

    Positions are rounded to float32, as are labels with fractions. Raises ValueError for labels of whole numbers that
    floats do not hold.
    """
    images: Channels = {"Depth.Z": labels.depth}
    for name, values, axes in (
        ("Normal", labels.normals, "XYZ"),
        ("Position", labels.positions, "XYZ"),
        ("UV", labels.uvs, "UV"),
        ("Vector", labels.flow, "XYZW"),
    ):
        if values is not None:
            images |= {f"{name}.{axis}": values[..., place] for place, axis in enumerate(axes)}
    ids = {"Thing": labels.thing_ids, "Category": labels.category_ids, "Material": labels.material_ids}
    images |= {f"{name}.X": _ids(values) for name, values in ids.items()}
    if len(labels.layer_depths) > 1:
        for number, (depth, things) in enumerate(zip(labels.layer_depths, labels.layer_ids, strict=True), start=1):
            images |= {f"Depth {number}.Z": depth, f"Thing {number}.X": _ids(things)}
    images |= {f"label {plain[name]}.X": _label(name, label) for name, label in labels.labels.items()}
    return {
        f"{LAYER}.{name}": np.ascontiguousarray(image, None if image.dtype == np.uint32 else np.float32)
        for name, image in images.items()
    }


def _ids(values: npt.NDArray[np.int32]) -> npt.NDArray[np.uint32]:
    return (values + 1).astype(np.uint32)


def _label(name: str, label: LabelColumn) -> npt.NDArray[Any]:
    if label.names is not None:
        return _ids(label.values)
    if not label.table.is_whole:
        return label.values
    is_there = label.values != label.table.missing
    highest = int(np.abs(label.values.astype(np.int64)).max(where=is_there, initial=0))
    if highest > MOST_EXACT:
        raise ValueError(
            f"exr: label {name!r} goes up to {highest:,}, and 32-bit floats hold whole numbers to {MOST_EXACT:,}: "
            "choose npy or npz"
        )
    return np.where(is_there, label.values, np.nan)


def write_exr(path: Path, channels: Channels) -> None:
    """Writes channels, row 0 on top. Raises OSError, ImportError."""
    library = _library()
    header = {"type": library.scanlineimage, "compression": library.ZIP_COMPRESSION}
    try:
        library.File(header, dict(channels)).write(str(path))  # a copy: what it is given, it changes
    except RuntimeError as error:
        raise OSError(" ".join(str(error).split())) from error
