"""Adaptive sampling by tiles: it ends the sampling of a tile when the estimate of its remaining noise is low.

A round of samples and the rounds before it give two images of the same scene with independent noise. The error of
their mean is estimated from their difference (Dammertz, Hanika, Keller and Lensch 2010, "A Hierarchical Automatic
Stopping Condition for Monte Carlo Global Illumination"; Cycles uses the same measure for each pixel). The worst block
of pixels decides whether a tile is finished, so that a small noisy spot in a quiet tile gets the samples it needs.
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
# With fewer samples, light that only few samples find may not have been found at all.
_LEAST_SAMPLES = 16
# The least size of a round as a share of the samples before it: smaller rounds say little about the noise.
_LEAST_SHARE = 0.25
# Avoids divisions by zero in black pixels.
_TINY = 1e-4


class AdaptiveSampling:
    """Ends the sampling of tiles of one image that are good enough: `render_progressively(..., sampling=sampling)`.

    tiles (rows, columns) bool: the unfinished tiles, of 32 x 32 pixels each; the first in the upper left corner.
    sample_counts (rows, columns) int64: the number of samples of each.

    Args:
        size: (width, height) of the image, in pixels.
        threshold: The allowed noise, above 0, in the mean of 8 x 8 pixels. The noise of a pixel is the error of its
            colour, red, green and blue together, over the square root of their sum, which approximates its visibility;
            the same for alpha. 0.01 is for final images, 0.1 for a first look, as in Cycles.
        min_samples: The least number of samples of every tile; 0, the default, for the number that an estimate needs:
            16.

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
        """The number of unfinished tiles."""
        return int(np.count_nonzero(self.tiles))

    @property
    def columns_left(self) -> npt.NDArray[np.int64]:
        """(rows,) int64: for each row of tiles, the number of pixel columns in unfinished tiles."""
        left: npt.NDArray[np.int64] = self.tiles @ self._widths
        return left

    @property
    def ray_count(self) -> int:
        """The number of samples of all pixels together."""
        return int(self._heights @ self.sample_counts @ self._widths)

    @property
    def mean_samples(self) -> float:
        """Samples of a pixel, on average."""
        return self.ray_count / max(int(self._heights.sum() * self._widths.sum()), 1)

    def keep_within(self, border: tuple[float, float, float, float]) -> None:
        """Excludes pixels outside a camera's border (left, right, bottom, top; 0 to 1); call it before any round."""
        width, height = self.size
        left, right = _pixels_within(border[0], border[1], width)
        low, high = _pixels_within(border[2], border[3], height)
        self._widths = _pixels_of_tiles(width, left, right)
        self._heights = _pixels_of_tiles(height, height - high, height - low)
        self.tiles = np.outer(self._heights, self._widths) > 0

    def pixels(self) -> npt.NDArray[np.bool_]:
        """Returns (H, W) bool: the pixels of unfinished tiles."""
        width, height = self.size
        return self.tiles.repeat(TILE_SIZE, axis=0)[:height].repeat(TILE_SIZE, axis=1)[:, :width]

    def note_round(self, before: Image, made: Image, done: int, count: int, rows: Rows | None = None) -> None:
        """Registers a round that was traced in the unfinished tiles, and finishes those that are good enough now.

        Args:
            before: (H, W, 4), the mean of the `done` samples before the round; ignored if there were none.
            made: The mean of the round's `count` samples only.
            rows: First and end of the traced rows, which must include whole tiles; None for the whole image.
        """
        first, end = (0, self.size[1]) if rows is None else rows
        part = slice(first // TILE_SIZE, -(-end // TILE_SIZE))
        tiles = self.tiles[part]
        self.sample_counts[part][tiles] += count
        if done + count < self.min_samples or count < _LEAST_SHARE * done or done == 0:
            return
        lines = slice(part.start * TILE_SIZE, part.stop * TILE_SIZE)
        # NaN is never good enough.
        tiles &= ~(_noise(before[lines], made[lines], done, count) < self.threshold)


def _pixels_within(low: float, high: float, length: int) -> tuple[int, int]:
    """First and end of a border's pixels along one side, as the renderer rounds: at least one."""
    first = min(int(np.float32(low) * np.float32(length)), length - 1)
    return first, max(int(np.float32(high) * np.float32(length)), first + 1)


def _pixels_of_tiles(length: int, first: int, end: int) -> npt.NDArray[np.int64]:
    """Returns, for each tile along a side of `length` pixels, its number of pixels from first to end."""
    edges = np.arange(0, length + TILE_SIZE, TILE_SIZE).clip(first, end)
    counts: npt.NDArray[np.int64] = edges[1:] - edges[:-1]
    return counts


def _noise(before: Image, made: Image, done: int, count: int) -> npt.NDArray[np.float32]:
    """(rows, columns) float32: the mean noise of each tile's worst block. The arguments are images of whole tiles.

    The error of the mean of two images with equal numbers of samples is estimated as half of their difference.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        difference = made - before
        mean = before + difference * np.float32(count / (done + count))
        difference = np.abs(difference) * np.float32(math.sqrt(done * count) / (done + count))
        color = difference[..., :3].sum(axis=2) / (_TINY + np.sqrt(np.maximum(mean[..., :3].sum(axis=2), 0.0)))
        alpha = difference[..., 3] / (_TINY + np.sqrt(np.maximum(mean[..., 3], 0.0)))
        # Empty pixels, outside of a border or around the objects, do not count.
        counted = _block_sums((mean != 0.0).any(axis=2).astype(np.float32))
        noise = _block_sums(np.maximum(color, alpha)) / np.maximum(counted, 1.0)
    worst: npt.NDArray[np.float32] = noise.max(axis=(1, 3))
    return worst


def _block_sums(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Sums blocks: (H, W) to (tile rows, blocks, tile columns, blocks). Parts of tiles outside the image count as 0."""
    rows, columns = (-(-length // TILE_SIZE) for length in values.shape)
    padded = np.zeros((rows * TILE_SIZE, columns * TILE_SIZE), np.float32)
    padded[: values.shape[0], : values.shape[1]] = values
    blocks = TILE_SIZE // _BLOCK_SIZE
    sums: npt.NDArray[np.float32] = padded.reshape(rows, blocks, _BLOCK_SIZE, columns, blocks, _BLOCK_SIZE).sum((2, 5))
    return sums
