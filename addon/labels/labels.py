"""The contents of a labelled image, and its file. Does not depend on Blender."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..extract.label_values import collections_of_objects
from ..support.files import replacing, write_arrays
from ..sync.boxes import boxes_of
from ..sync.lookup import MISS, LabelColumn, LabelValue, SceneLabel

if TYPE_CHECKING:
    from perfect_bvh import Camera

    from ..live.scene_sync import SceneSync

# The meaning of labels' numbers: instances, with the names and labels that users gave their objects.


@dataclass(frozen=True, slots=True)
class Thing:
    """One object, or one instance of it, in a labelled image.

    Attributes:
        name: Of the object.
        instancer: The name of the object that shows it, "" for a plain one.
        instance_id: Of this instance; it lasts while its sync does.
        pass_index: The object's.
        category: A row of the image's categories, -1 for none.
        collections: The names of all that hold the object itself, sorted.
        labels: The values of those that were asked for, by name, None for none; where only materials have a label, what
            all of the object's agree on.
        box3d: The box around it along its object's own axes, in world space: "center" (3), "size" (3) along the axes,
            and "axes", unit vectors of the object's x, y and z. They are not at right angles if the object is sheared.
    """

    name: str
    instancer: str
    instance_id: int
    pass_index: int
    category: int = MISS
    collections: tuple[str, ...] = ()
    labels: Mapping[str, LabelValue] = field(default_factory=dict)
    box3d: Mapping[str, Any] = field(default_factory=dict)


def find_things(
    sync: SceneSync, instance_ids: npt.NDArray[np.int32], category: SceneLabel, labels: Mapping[str, SceneLabel]
) -> tuple[tuple[Thing, ...], tuple[str, ...]]:
    """Returns a `Thing` for each of (N,) instances, and the categories' names.

    Args:
        category: The label that says them, of names.
        labels: Others by their names.
    """
    found, rows = sync.describe(instance_ids), sync.instance_rows(instance_ids)
    indices = {obj.session_uid: obj.pass_index for obj in sync.record.objects}
    holders = collections_of_objects()
    names = category.table.names or ()
    numbers = {name: row for row, name in enumerate(names)}
    categories = category.of_things(sync.record, rows)
    columns = {name: label.of_things(sync.record, rows) for name, label in labels.items()}
    boxes = boxes_of(sync.record, rows)
    centers, sizes, axes = (part.tolist() for part in boxes)
    things = []
    for row, uid in enumerate(found.session_uids.tolist()):
        things.append(
            Thing(
                name=str(found.names[row]),
                instancer=str(found.parent_names[row]),
                instance_id=int(instance_ids[row]),
                pass_index=indices.get(uid, 0),
                category=numbers.get(str(categories[row]), MISS) if categories[row] is not None else MISS,
                collections=holders.get(uid, ()),
                labels={name: values[row] for name, values in columns.items()},
                box3d={"center": centers[row], "size": sizes[row], "axes": axes[row]},
            )
        )
    return tuple(things), names


# Masks ---------------------------------------------------------------------------------------------------------------
# The pixels of many object instances, a mask for each; masks may overlap.


Int64Array = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Masks:
    """N masks of images of one size, as the pixels of each, which takes no more memory than there is to tell.

    Attributes:
        size: (width, height).
        splits: (N + 1,) int64, where each mask begins among the pixels.
        pixels: (P,) int32, rising in each mask: row * width + column, row 0 on top.
    """

    size: tuple[int, int]
    splits: Int64Array
    pixels: npt.NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.splits) - 1

    @property
    def areas(self) -> Int64Array:
        """(N,) int64: how many pixels each has."""
        return np.diff(self.splits)

    def pixels_of(self, number: int) -> npt.NDArray[np.int32]:
        """(A,) int32: those of one mask, rising."""
        return self.pixels[self.splits[number] : self.splits[number + 1]]

    def image_of(self, number: int) -> Bools:
        """(H, W) bool, row 0 on top."""
        width, height = self.size
        image = np.zeros(width * height, np.bool_)
        image[self.pixels_of(number)] = True
        return image.reshape(height, width)

    def boxes(self) -> npt.NDArray[np.int32]:
        """(N, 4) int32: left, top, width and height of the box around each mask; zeros around an empty one."""
        boxes = np.zeros((len(self), 4), np.int32)
        full = np.flatnonzero(self.areas)
        if len(full):
            starts = self.splits[full]
            rows, columns = np.divmod(self.pixels, self.size[0])
            left, right = np.minimum.reduceat(columns, starts), np.maximum.reduceat(columns, starts)
            top, bottom = np.minimum.reduceat(rows, starts), np.maximum.reduceat(rows, starts)
            boxes[full] = np.stack([left, top, right - left + 1, bottom - top + 1], axis=1)
        return boxes


def masks_of(owners: Int64Array, pixels: Int64Array, count: int, size: tuple[int, int]) -> Masks:
    """owners, pixels: (P,) int64, whose pixel is which, in any order and any number of times. count: of masks."""
    pixel_count = size[0] * size[1]
    keys = distinct(owners * pixel_count + pixels)
    splits = np.searchsorted(keys, np.arange(count + 1, dtype=np.int64) * pixel_count)
    return Masks(size, splits.astype(np.int64), (keys % pixel_count).astype(np.int32))


def distinct(keys: Int64Array) -> Int64Array:
    """Returns the result of np.unique, faster: most of its input consists of sorted runs."""
    ordered = np.sort(keys, kind="stable")
    is_first = np.ones(len(ordered), np.bool_)
    np.not_equal(ordered[1:], ordered[:-1], out=is_first[1:])
    return ordered[is_first]


# Labels --------------------------------------------------------------------------------------------------------------


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
    """An image of H x W pixels, row 0 on top: the hits of rays through the pixels' centres. Nothing is blended.

    Attributes:
        depth: (H, W) float32, along the view axis (in panoramas along the ray), 1e10 where nothing was hit.
        positions: (H, W, 3) float64, in the world.
        normals: (H, W, 3) float32, shading normals in the world, towards the viewer.
        uvs: (H, W, 2) float32, of the map that is active for renders. Zero where there is no surface or no map.
        thing_ids: (H, W) int32, rows of `things`.
        material_ids: (H, W) int32, rows of material_names. -1 where there is none.
        category_ids: (H, W) int32, rows of `categories`, -1 for none.
        flow: (H, W, 4) float32, as Blender's Vector pass has it, or None.
        layer_depths, layer_ids: (K, H, W) float32 and int32, the K nearest surfaces along each ray, nearest first:
            their depths and rows of `things`; 1e10 and -1 where there are fewer.
        visible, amodal: A mask for each object instance: its visible pixels, and all pixels whose rays hit it, even
            behind others. Visible masks never overlap.
        things: The object instances that any ray hits, in the order of their instance_id.
        categories: The names of all categories in the file.
        labels: By the requested names, (H, W) int32 or float64, see `label_image`.
        camera: The camera of the image, see `describe_camera`.
        warnings: Data that could not be read, as sentences.
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
    camera: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def size(self) -> tuple[int, int]:
        """(width, height)."""
        return self.visible.size

    @property
    def visible_shares(self) -> Floats:
        """(N,) float32: the visible share of each `Thing`'s pixels, 0 to 1."""
        return (self.visible.areas / np.maximum(self.amodal.areas, 1)).astype(np.float32)

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Returns all arrays, without texts, by their names in files."""
        masks = {"visible": self.visible, "amodal": self.amodal}
        of_masks = {f"{name}_{part}": getattr(mask, part) for name, mask in masks.items() for part in MASK_PARTS}
        arrays = {name: of_masks[name] if name in of_masks else getattr(self, name) for name in ARRAYS}
        if self.flow is not None:
            arrays["flow"] = self.flow
        return arrays | {f"label_{name}": label.values for name, label in self.labels.items()}

    def described_things(self) -> list[dict[str, Any]]:
        """Returns the `things` as JSON."""
        names = [each.name for each in fields(Thing)]  # asdict copies all that is in them, which takes long
        return [{name: getattr(thing, name) for name in names} for thing in self.things]

    def described_labels(self) -> dict[str, Any]:
        """Returns the meaning of the labels' values, as JSON has it."""
        return {name: label.table.described() for name, label in self.labels.items()}

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes everything into a compressed .npz file (the ending is added if it is missing) and returns its path.

        Masks are kept as `visible_splits` and `visible_pixels`, and likewise of `amodal`; labels as `label_NAME`;
        `things` and `camera` as JSON, and `labels`, the meaning of the labels' values, also as JSON. An existing file
        is replaced once the new one is complete.

        Raises:
            OSError: With the reason if it cannot be written.
        """
        path = Path(path)
        if path.suffix.lower() != ".npz":
            path = path.with_name(path.name + ".npz")
        arrays = self.arrays()
        arrays["things"] = np.array(json.dumps(self.described_things()))
        arrays["categories"] = np.array(self.categories, np.str_)
        arrays["material_names"] = np.array(self.material_names, np.str_)
        arrays["labels"] = np.array(json.dumps(self.described_labels()))
        arrays["camera"] = np.array(json.dumps(self.camera))
        with replacing(path) as name:
            write_arrays(name, arrays, is_compressed=True)
        return path


def describe_camera(camera: Camera, frame: tuple[int, int], cut: tuple[slice, slice]) -> dict[str, Any]:
    """Describe a camera as JSON has it, in the convention of OpenCV: x to the right, y down, z ahead.

    Args:
        camera: Of the whole frame.
        frame: (width, height) of that in pixels.
        cut: The rows and columns of it that the image has.

    Returns:
        "projection", and "world_to_camera", (3, 4); of a perspective camera also "intrinsics", (3, 3) in pixels, by
        which the centre of the upper left pixel is (0, 0).
    """
    place = np.diag([1.0, -1.0, -1.0, 1.0]) @ np.linalg.inv(camera.matrix)
    found: dict[str, Any] = {"projection": camera.projection, "world_to_camera": place[:3].tolist()}
    if camera.projection == "perspective":
        (left, right, bottom, top), (width, height), (rows, columns) = camera.window, frame, cut
        across, down = width / (right - left), height / (top - bottom)
        middle = -left * across - columns.start - 0.5, top * down - rows.start - 0.5
        found["intrinsics"] = [[across, 0.0, middle[0]], [0.0, down, middle[1]], [0.0, 0.0, 1.0]]
    return found


# Run lengths ---------------------------------------------------------------------------------------------------------
# Masks as run lengths in the format of COCO: all at once, from pixels sorted by columns.


def run_lengths(masks: Masks) -> list[dict[str, Any]]:
    """Returns masks in COCO's uncompressed form: {"size": [H, W], "counts": runs of 0, 1, 0 ..., by columns}."""
    counts, splits = _counts(masks)
    width, height = masks.size
    runs = counts.tolist()
    return [
        {"size": [height, width], "counts": runs[first:end]}
        for first, end in zip(splits[:-1].tolist(), splits[1:].tolist(), strict=True)
    ]


def _counts(masks: Masks) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Returns all masks' runs, concatenated, and the beginning of each mask's runs, (N + 1,).

    Each run of ones has the position where it begins, preceded by the end of the previous one. Their differences are
    the lengths. The rest of the image after the last run follows, if there is any.
    """
    width, height = masks.size
    size, number = width * height, len(masks)
    rows, columns = np.divmod(masks.pixels.astype(np.int64), width)
    owners = np.repeat(np.arange(number, dtype=np.int64), masks.areas)
    # One more than an image's pixels, so that a run never goes on in the next mask.
    places = np.sort(owners * (size + 1) + columns * height + rows)
    is_apart = np.diff(places) != 1
    begins = places[np.concatenate([[True], is_apart])] if len(places) else places
    ends = places[np.concatenate([is_apart, [True]])] + 1 if len(places) else places
    runs_of = np.bincount(begins // (size + 1), minlength=number)
    # A mask: where its image begins, then begins and ends by turns, then the image's end.
    bounds_of = 2 * runs_of + 2
    splits = np.concatenate([[0], np.cumsum(bounds_of)]).astype(np.int64)
    bounds = np.empty(int(splits[-1]), np.int64)
    is_edge = np.zeros(len(bounds), np.bool_)
    is_edge[splits[:-1]] = is_edge[splits[1:] - 1] = True
    starts = np.arange(number, dtype=np.int64) * (size + 1)
    bounds[splits[:-1]], bounds[splits[1:] - 1] = starts, starts + size
    bounds[~is_edge] = np.stack([begins, ends], axis=1).ravel()
    lengths = np.diff(bounds, append=0)
    is_length = np.ones(len(bounds), np.bool_)
    is_length[splits[1:] - 1] = False  # from one mask to the next
    is_length[splits[1:] - 2] = lengths[splits[1:] - 2] > 0  # nothing is left
    kept = np.concatenate([[0], np.cumsum(is_length)])[splits]
    return lengths[is_length], kept.astype(np.int64)
