"""What a labelled image holds, and its file. Knows no Blender."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..support.arrays import write_arrays
from ..support.files import replacing
from ..sync.label_columns import LabelColumn
from .masks import Masks
from .things import Thing

Floats = npt.NDArray[np.float32]
Int32Array = npt.NDArray[np.int32]

MASK_PARTS = ("splits", "pixels")
# What every image has, by the names in files.
ARRAYS = (
    "depth",
    "positions",
    "normals",
    "uvs",
    "thing_ids",
    "material_ids",
    "category_ids",
    "layer_depths",
    "layer_ids",
    "visible_shares",
    *(f"{mask}_{part}" for mask in ("visible", "amodal") for part in MASK_PARTS),
)


@dataclass(frozen=True, slots=True, eq=False)
class Labels:
    """Of an image of H x W pixels, row 0 on top: what the ray through each pixel's centre meets. Nothing is blended.

    depth: (H, W) float32, along the view axis (in panoramas along the ray), 1e10 where nothing was hit. positions:
    (H, W, 3) float64, in the world. normals: (H, W, 3) float32, shading normals in the world, towards the viewer.
    uvs: (H, W, 2) float32, of the map that is active for renders. All zero where there is nothing or no map.
    thing_ids: (H, W) int32, rows of `things`. material_ids: (H, W) int32, rows of material_names. -1 where there is
    none. category_ids: (H, W) int32, rows of `categories`, -1 for none.
    flow: (H, W, 4) float32, as Blender's Vector pass has it, or None.
    layer_depths, layer_ids: (K, H, W) float32 and int32, the K nearest surfaces along each ray, nearest first: their
    depths and rows of `things`; 1e10 and -1 where there are fewer.
    visible, amodal: a mask for each thing: where it is seen, and where any ray meets it, whatever is before it. Those
    that are visible never overlap.
    things: what is met by any ray, in the order of their instance_id. categories: the names of all that the file has.
    labels: by the names that were asked for, (H, W) int32 or float64, see `label_image`.
    warnings: what could not be read, as sentences.
    """

    depth: Floats
    positions: npt.NDArray[np.float64]
    normals: Floats
    uvs: Floats
    thing_ids: Int32Array
    material_ids: Int32Array
    category_ids: Int32Array
    layer_depths: Floats
    layer_ids: Int32Array
    visible: Masks
    amodal: Masks
    things: tuple[Thing, ...]
    categories: tuple[str, ...]
    material_names: tuple[str, ...]
    labels: Mapping[str, LabelColumn] = field(default_factory=dict)
    flow: Floats | None = None
    warnings: tuple[str, ...] = ()

    @property
    def size(self) -> tuple[int, int]:
        """(width, height)."""
        return self.visible.size

    @property
    def visible_shares(self) -> Floats:
        """(N,) float32: of each thing's pixels those where it is seen, 0 to 1."""
        return (self.visible.areas / np.maximum(self.amodal.areas, 1)).astype(np.float32)

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """All that are no texts, by the names that they have in files."""
        masks = {"visible": self.visible, "amodal": self.amodal}
        of_masks = {f"{name}_{part}": getattr(mask, part) for name, mask in masks.items() for part in MASK_PARTS}
        arrays = {name: of_masks[name] if name in of_masks else getattr(self, name) for name in ARRAYS}
        if self.flow is not None:
            arrays["flow"] = self.flow
        return arrays | {f"label_{name}": label.values for name, label in self.labels.items()}

    def described_things(self) -> list[dict[str, Any]]:
        """The things, as JSON has them."""
        names = [each.name for each in fields(Thing)]  # asdict copies all that is in them, which takes long
        return [{name: getattr(thing, name) for name in names} for thing in self.things]

    def described_labels(self) -> dict[str, Any]:
        """What the values of labels are, as JSON has it."""
        return {name: label.table.described() for name, label in self.labels.items()}

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes everything into a compressed .npz file (the ending is added if it is missing) and returns its path.

        Masks are kept as `visible_splits` and `visible_pixels`, and likewise of `amodal`; labels as `label_NAME`;
        `things` as JSON, as well as `labels`, which says what the labels' values are. A file of that name is replaced
        once the new one is complete. Raises OSError with the reason if it cannot be written.
        """
        path = Path(path)
        if path.suffix.lower() != ".npz":
            path = path.with_name(path.name + ".npz")
        arrays = self.arrays()
        arrays["things"] = np.array(json.dumps(self.described_things()))
        arrays["categories"] = np.array(self.categories, np.str_)
        arrays["material_names"] = np.array(self.material_names, np.str_)
        arrays["labels"] = np.array(json.dumps(self.described_labels()))
        with replacing(path) as name:
            write_arrays(name, arrays, is_compressed=True)
        return path
