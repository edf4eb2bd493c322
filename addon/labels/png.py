"""Images of labels as PNG files of 16 bits of grey, by Pillow. Knows no Blender.

Depth as BOP and KITTI keep it: whole steps of a scale, 0 where there is nothing. Ids are rows and numbers + 1, 0 for
nothing. Files say nothing of gamma or colour profiles, so that readers give the numbers as they are.
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

Uint16Array = npt.NDArray[np.uint16]
MOST = 65535
NOTHING_IN_SIGHT = 1e9  # depths beyond are of rays that met nothing


def check_png() -> None:
    """Raises ImportError with what to install."""
    _library()


def _library() -> Any:
    return data_library("PIL.Image", "PNG files need Pillow")


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
        raise ValueError(
            f"png: label {name!r} has fractions, or -1 as a value: choose exr, npy or npz, or leave it out"
        )
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
    """Writes (H, W), row 0 on top; the same bytes for the same image. Raises ImportError without Pillow, OSError."""
    with path.open("wb") as file:
        _library().fromarray(image).save(file, format="PNG", compress_level=1)  # a frame has several: speed over size
