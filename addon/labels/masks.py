"""The pixels of many things, each with a mask of its own; they may overlap. Knows no Blender."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Int64Array = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Masks:
    """N masks of images of one size, as the pixels of each, which takes no more memory than there is to tell.

    size: (width, height). splits: (N + 1,) int64, where each mask begins among the pixels. pixels: (P,) int32, rising
    in each mask: row * width + column, row 0 on top.
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
    """What np.unique gives, sooner: most of what it is asked here is runs that are sorted already."""
    ordered = np.sort(keys, kind="stable")
    is_first = np.ones(len(ordered), np.bool_)
    np.not_equal(ordered[1:], ordered[:-1], out=is_first[1:])
    return ordered[is_first]
