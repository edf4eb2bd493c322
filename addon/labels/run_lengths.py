"""Masks as run lengths in the format of COCO: all at once, from pixels sorted by columns. Knows no Blender."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .masks import Masks


def run_lengths(masks: Masks) -> list[dict[str, Any]]:
    """Of each mask what COCO calls uncompressed: {"size": [H, W], "counts": runs of 0, 1, 0 ..., column by column}."""
    counts, splits = _counts(masks)
    width, height = masks.size
    runs = counts.tolist()
    return [
        {"size": [height, width], "counts": runs[first:end]}
        for first, end in zip(splits[:-1].tolist(), splits[1:].tolist(), strict=True)
    ]


def _counts(masks: Masks) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """All masks' runs one after the other, and where those of each begin, (N + 1,).

    Each run of ones has the place where it begins, before that the end of the one before; their differences are the
    lengths. After the last there is what is left of the image, if anything is.
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
