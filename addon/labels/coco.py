"""Labelled images as one JSON file of the format of COCO, with masks as run lengths. Knows no Blender."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from ..support.files import replacing
from .labels import Labels
from .masks import Masks

MISSING = "COCO files need pycocotools: pip install 'perfect-bvh[data]'"


class CocoFile:
    """Gathers images and writes them: `coco.add(labels, "image_0001.png")` for each, then `coco.save(path)`.

    Each thing that is seen is an annotation: `segmentation`, `bbox` and `area` of what is seen of it, beside them
    `amodal_segmentation`, `amodal_bbox`, `amodal_area` and `visible_share`. What is hidden altogether stands in a list
    of its own, `hidden`, with the same fields. Categories are numbered from 1, in the order in which they are first
    met. Raises ImportError without pycocotools.
    """

    def __init__(self) -> None:
        try:
            from pycocotools import mask
        except ImportError as error:
            raise ImportError(MISSING) from error
        self._encode = mask.encode
        self._images: list[dict[str, Any]] = []
        self._annotations: list[dict[str, Any]] = []
        self._hidden: list[dict[str, Any]] = []
        self._categories: dict[str, int] = {}

    def add(self, labels: Labels, file_name: str) -> int:
        """Adds an image; file_name: of the picture that belongs to it. Returns its number in the file."""
        width, height = labels.size
        image_id = len(self._images) + 1
        self._images.append({"id": image_id, "file_name": file_name, "width": width, "height": height})
        parts = [self._parts(masks) for masks in (labels.visible, labels.amodal)]
        shares = labels.visible_shares.tolist()
        for row, thing in enumerate(labels.things):
            (visible, box, area), (amodal, amodal_box, amodal_area) = (each[row] for each in parts)
            found = self._annotations if area else self._hidden
            found.append(
                {
                    "id": len(self._annotations) + len(self._hidden) + 1,
                    "image_id": image_id,
                    "category_id": self._category(labels.categories[thing.category] if thing.category >= 0 else ""),
                    "iscrowd": 0,
                    "segmentation": visible,
                    "bbox": box,
                    "area": area,
                    "amodal_segmentation": amodal,
                    "amodal_bbox": amodal_box,
                    "amodal_area": amodal_area,
                    "visible_share": shares[row],
                    "name": thing.name,
                    "instancer": thing.instancer,
                    "instance_id": thing.instance_id,
                    "pass_index": thing.pass_index,
                }
            )
        return image_id

    def _category(self, name: str) -> int:
        return self._categories.setdefault(name or "none", len(self._categories) + 1)

    def _parts(self, masks: Masks) -> list[tuple[dict[str, Any], list[int], int]]:
        """Run lengths, box and area of each mask."""
        width, height = masks.size
        # The run lengths are those of columns.
        image = np.zeros((height, width), np.uint8, order="F")
        made = []
        for number, (box, area) in enumerate(zip(masks.boxes().tolist(), masks.areas.tolist(), strict=True)):
            rows, columns = np.divmod(masks.pixels_of(number), width)
            image[rows, columns] = 1
            runs = self._encode(image)
            image[rows, columns] = 0
            made.append(({"size": list(map(int, runs["size"])), "counts": runs["counts"].decode()}, box, area))
        return made

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes the file; one of that name is replaced once the new one is complete. Raises OSError."""
        path = Path(path)
        content = {
            "images": self._images,
            "annotations": self._annotations,
            "categories": [{"id": number, "name": name} for name, number in self._categories.items()],
            "hidden": self._hidden,
        }
        with replacing(path) as name:
            name.write_text(json.dumps(content), encoding="utf-8")
        return path
