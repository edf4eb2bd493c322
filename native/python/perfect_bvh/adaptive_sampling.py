"""Where an image has samples enough: adaptive sampling by tiles, after an estimate of the noise that is left.

What a round of samples shows and what those before it show are two images of the same thing, each with noise of its
own. By as much as they differ their mean is off (Dammertz, Hanika, Keller and Lensch 2010, "A Hierarchical Automatic
Stopping Condition for Monte Carlo Global Illumination"; Cycles takes the same measure of each pixel). A tile is
finished by its worst block of pixels, so that a small spot of noise in a quiet tile gets what it needs.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ._checks import check_count, check_number
from ._render_arguments import check_size

Image = npt.NDArray[np.float32]
Rows = tuple[int, int]

TILE_SIZE = 32
"""Pixels of the renderer's tiles each way; the first one lies in the upper left corner of the image."""

_BLOCK_SIZE = 8  # pixels each way that are judged together; it divides TILE_SIZE
# Before that, light that only few samples find may not have been found at all.
_LEAST_SAMPLES = 16
# Of the samples before it, what a round must have at least: fewer say little of the noise.
_LEAST_SHARE = 0.25
# Of a division by what may be black.
_TINY = 1e-4


class AdaptiveSampling:
    """Ends the sampling of tiles of one image that are good enough: `render_progressively(..., sampling=sampling)`.

    tiles (rows, columns) bool: of 32 x 32 pixels each, those that are not finished; the first in the upper left corner.
    sample_counts (rows, columns) int64: how many samples each has.

    Args:
        size: (width, height) of the image, in pixels.
        threshold: The noise that may stay, above 0, in the mean of 8 x 8 pixels: of a pixel what its colour is off by,
            red, green and blue together, over the square root of their sum, so that it counts as it is seen; of alpha
            alike. 0.01 is for images that will be kept, 0.1 for a first look, as in Cycles.
        min_samples: That every tile gets; 0, the default, for as many as an estimate needs: 16.

    Raises:
        ValueError: For bad arguments.
    """

    def __init__(self, size: tuple[int, int], threshold: float, min_samples: int = 0) -> None:
        self.size = check_size("AdaptiveSampling", size)
        self.threshold = check_number("AdaptiveSampling", "threshold", threshold, 1e-30, 1e30)
        least = check_count("AdaptiveSampling", "min_samples", min_samples, 0)
        self.min_samples = least or _LEAST_SAMPLES
        self._widths, self._heights = (_pixels_of_tiles(length, 0, length) for length in self.size)
        self.tiles: npt.NDArray[np.bool_] = np.ones((len(self._heights), len(self._widths)), np.bool_)
        self.sample_counts: npt.NDArray[np.int64] = np.zeros(self.tiles.shape, np.int64)

    @property
    def is_finished(self) -> bool:
        """Whether no tile needs more samples."""
        return self.tile_count == 0

    @property
    def tile_count(self) -> int:
        """How many tiles are not finished."""
        return int(np.count_nonzero(self.tiles))

    @property
    def columns_left(self) -> npt.NDArray[np.int64]:
        """(rows,) int64: of each row of tiles, how many columns of pixels are in those that are not finished."""
        left: npt.NDArray[np.int64] = self.tiles @ self._widths
        return left

    @property
    def ray_count(self) -> int:
        """Samples of all pixels together."""
        return int(self._heights @ self.sample_counts @ self._widths)

    @property
    def mean_samples(self) -> float:
        """Samples of a pixel, on average."""
        return self.ray_count / max(int(self._heights.sum() * self._widths.sum()), 1)

    def keep_within(self, border: tuple[float, float, float, float]) -> None:
        """Pixels outside of a camera's border (left, right, bottom, top; 0 to 1) are not traced; before any is."""
        width, height = self.size
        left, right = _pixels_within(border[0], border[1], width)
        low, high = _pixels_within(border[2], border[3], height)
        self._widths = _pixels_of_tiles(width, left, right)
        self._heights = _pixels_of_tiles(height, height - high, height - low)
        self.tiles = np.outer(self._heights, self._widths) > 0

    def pixels(self) -> npt.NDArray[np.bool_]:
        """(H, W) bool: those of the tiles that are not finished."""
        width, height = self.size
        return self.tiles.repeat(TILE_SIZE, axis=0)[:height].repeat(TILE_SIZE, axis=1)[:, :width]

    def note_round(self, before: Image, made: Image, done: int, count: int, rows: Rows | None = None) -> None:
        """A round was traced in the tiles that are not finished; those that are good enough now are.

        Args:
            before: (H, W, 4), the mean of the `done` samples before the round; not looked at if there were none.
            made: Of the round's `count` samples alone.
            rows: First and end of those that were traced, all of a tile's rows in the image at once; None for the whole
                image.
        """
        first, end = (0, self.size[1]) if rows is None else rows
        part = slice(first // TILE_SIZE, -(-end // TILE_SIZE))
        tiles = self.tiles[part]
        self.sample_counts[part][tiles] += count
        if done + count < self.min_samples or count < _LEAST_SHARE * done or done == 0:
            return
        lines = slice(part.start * TILE_SIZE, part.stop * TILE_SIZE)
        # Not a number: never good enough.
        tiles &= ~(_noise(before[lines], made[lines], done, count) < self.threshold)


def _pixels_within(low: float, high: float, length: int) -> tuple[int, int]:
    """First and end of a border's pixels along one side, as the renderer rounds: at least one."""
    first = min(int(np.float32(low) * np.float32(length)), length - 1)
    return first, max(int(np.float32(high) * np.float32(length)), first + 1)


def _pixels_of_tiles(length: int, first: int, end: int) -> npt.NDArray[np.int64]:
    """Of each tile along a side of so many pixels, how many pixels lie from first to end."""
    edges = np.arange(0, length + TILE_SIZE, TILE_SIZE).clip(first, end)
    counts: npt.NDArray[np.int64] = edges[1:] - edges[:-1]
    return counts


def _noise(before: Image, made: Image, done: int, count: int) -> npt.NDArray[np.float32]:
    """(rows, columns) float32: of each tile the mean noise of its worst block. The arguments are images of whole tiles.

    The mean of both images is off by as much as they differ, were they of as many samples each, by half of it.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        difference = made - before
        mean = before + difference * np.float32(count / (done + count))
        difference = np.abs(difference) * np.float32(math.sqrt(done * count) / (done + count))
        color = difference[..., :3].sum(axis=2) / (_TINY + np.sqrt(np.maximum(mean[..., :3].sum(axis=2), 0.0)))
        alpha = difference[..., 3] / (_TINY + np.sqrt(np.maximum(mean[..., 3], 0.0)))
        # Where there is nothing, outside of a border or around what is seen, nothing is counted.
        counted = _block_sums((mean != 0.0).any(axis=2).astype(np.float32))
        noise = _block_sums(np.maximum(color, alpha)) / np.maximum(counted, 1.0)
    worst: npt.NDArray[np.float32] = noise.max(axis=(1, 3))
    return worst


def _block_sums(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(H, W) to (tile rows, blocks, tile columns, blocks); what tiles reach beyond the image counts as 0."""
    rows, columns = (-(-length // TILE_SIZE) for length in values.shape)
    padded = np.zeros((rows * TILE_SIZE, columns * TILE_SIZE), np.float32)
    padded[: values.shape[0], : values.shape[1]] = values
    blocks = TILE_SIZE // _BLOCK_SIZE
    sums: npt.NDArray[np.float32] = padded.reshape(rows, blocks, _BLOCK_SIZE, columns, blocks, _BLOCK_SIZE).sum((2, 5))
    return sums
