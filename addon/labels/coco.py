"""Labelled images as one JSON file of the format of COCO, with masks as run lengths. Does not depend on Blender.

An image is a row, a line of JSON, which does not refer to other images. Rows of many images from any source are joined
in one pass for each list of the file, a row at a time: the file may be larger than memory.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from ..support.files import replacing
from .labels import Labels, Masks, run_lengths

# A row's lists of object instances, and whether they are visible: fully hidden ones are in a separate list.
SEEN, HIDDEN = "annotations", "hidden"
_MOST_CHARACTERS = 13  # of a whole number of 64 bits

Row = dict[str, Any]


def image_row(labels: Labels, file_name: str) -> Row:
    """An image with its object instances, which are numbered once all images are together.

    Args:
        file_name: Of the picture that belongs to it.
    """
    width, height = labels.size
    parts = [_parts(masks) for masks in (labels.visible, labels.amodal)]
    shares = labels.visible_shares.tolist()
    things = []
    for number, thing in enumerate(labels.things):
        (visible, box, area), (amodal, amodal_box, amodal_area) = (each[number] for each in parts)
        things.append(
            {
                "category": labels.categories[thing.category] if thing.category >= 0 else "",
                "iscrowd": 0,
                "segmentation": visible,
                "bbox": box,
                "area": area,
                "amodal_segmentation": amodal,
                "amodal_bbox": amodal_box,
                "amodal_area": amodal_area,
                "visible_share": shares[number],
                "name": thing.name,
                "instancer": thing.instancer,
                "instance_id": thing.instance_id,
                "pass_index": thing.pass_index,
                "collections": list(thing.collections),
                "box3d": dict(thing.box3d),
                "attributes": dict(thing.labels),
            }
        )
    facts = {"width": width, "height": height, "camera": dict(labels.camera)}
    return {"file_name": file_name, **facts, "categories": list(labels.categories), "things": things}


def _parts(masks: Masks) -> list[tuple[dict[str, Any], list[int], int]]:
    """Run lengths, box and area of each mask."""
    found = zip(run_lengths(masks), masks.boxes().tolist(), masks.areas.tolist(), strict=True)
    return [({**runs, "counts": compressed(runs["counts"])}, box, area) for runs, box, area in found]


def compressed(counts: list[int]) -> str:
    """Writes run lengths as COCO's API does: from the fourth on less the one before the last, five bits a character."""
    values = np.array(counts, np.int64)
    values[3:] -= np.array(counts, np.int64)[1:-2]
    characters = np.zeros((len(values), _MOST_CHARACTERS), np.uint8)
    goes_on = np.ones(len(values), np.bool_)
    for place in range(_MOST_CHARACTERS):
        low, values = values & 31, values >> 5
        has_more = np.where(low & 16, values != -1, values != 0)  # the last character's fifth bit is the sign
        characters[goes_on, place] = (48 + low + 32 * has_more)[goes_on]
        goes_on &= has_more
    return characters[characters > 0].tobytes().decode("ascii")


def write_rows(rows: Iterable[Row], path: Path) -> None:
    """A line for each; a file of that name is replaced once the new one is complete. Raises OSError."""
    with replacing(path) as name, name.open("w", encoding="utf-8") as file:
        for row in rows:
            file.write(json.dumps(row) + "\n")


def read_rows(paths: Iterable[Path]) -> Iterator[Row]:
    """Reads files from `write_rows`, one after the other. Raises OSError."""
    for path in paths:
        with path.open(encoding="utf-8") as file:
            for line in file:
                yield json.loads(line)


def join_rows(rows: Callable[[], Iterable[Row]], path: Path) -> None:
    """Writes one file of the format of COCO. rows: gives all rows, in order, each time it is called. Raises OSError."""
    with replacing(path) as name, name.open("w", encoding="utf-8") as file:
        file.write("{")
        _write_list(file, "images", _images(rows()))
        categories: dict[str, int] = {}
        file.write(", ")
        _write_list(file, SEEN, _things(rows(), SEEN, categories))
        file.write(", ")
        _write_list(file, "categories", ({"id": number, "name": name} for name, number in categories.items()))
        file.write(", ")
        _write_list(file, HIDDEN, _things(rows(), HIDDEN, categories))
        file.write("}")


def _write_list(file: TextIO, name: str, items: Iterable[Row]) -> None:
    file.write(f"{json.dumps(name)}: [")
    for number, item in enumerate(items):
        file.write((", " if number else "") + json.dumps(item))
    file.write("]")


def _images(rows: Iterable[Row]) -> Iterator[Row]:
    for image_id, row in enumerate(rows, 1):
        yield {"id": image_id, **{name: row[name] for name in ("file_name", "width", "height", "camera")}}


def _things(rows: Iterable[Row], which: str, categories: dict[str, int]) -> Iterator[Row]:
    """Yields the visible or the hidden instances; both are numbered together. categories: the rows' are added."""
    identifier = 0
    for image_id, row in enumerate(rows, 1):
        for name in row["categories"]:  # numbered as in images
            categories.setdefault(name, len(categories) + 1)
        for thing in row["things"]:
            identifier += 1
            rest = dict(thing)
            category_id = categories.setdefault(rest.pop("category") or "none", len(categories) + 1)
            if (SEEN if thing["area"] else HIDDEN) == which:
                yield {"id": identifier, "image_id": image_id, "category_id": category_id, **rest}


class CocoFile:
    """Gathers images and writes them: `coco.add(labels, "image_0001.png")` for each, then `coco.save(path)`.

    Each visible object instance is an annotation. `segmentation`, `bbox` and `area` describe its visible part;
    `amodal_segmentation`, `amodal_bbox`, `amodal_area` and `visible_share` describe all of it. Fully hidden ones are in
    a separate list, `hidden`, with the same fields. `box3d` is as `Thing.box3d`. `attributes` are the requested labels,
    null for instances without them, and the instance's `collections`. An image has its `camera`, as `Labels`.
    Categories are all of the file, numbered from 1 in the order of the images' own, then "none" if one has none.
    """

    def __init__(self) -> None:
        self._rows: list[Row] = []

    def add(self, labels: Labels, file_name: str) -> int:
        """Adds an image; file_name: of the picture that belongs to it. Returns its number in the file."""
        self._rows.append(image_row(labels, file_name))
        return len(self._rows)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes the file; one of that name is replaced once the new one is complete. Raises OSError."""
        path = Path(path)
        join_rows(lambda: self._rows, path)
        return path
