"""What there is of an image that is still being traced: fine rows over coarse ones, to be read while it grows.

One thread writes, another reads. Rows of the full image stand in it by the renderer's tiles; for each tile's rows it is
known how fine they are and when they last changed, so that a reader fetches only what it has not got. Knows no Blender.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .progressive import TILE_ROWS, Rows

Image = npt.NDArray[np.float32]
Pixels = npt.NDArray[np.bool_]

# Full rows are read in pieces of so many tiles: one that has not changed stays with the reader.
STRIP_TILES = 4

# Of changes, whichever canvas they belong to: no two have the same.
_numbers = itertools.count(1)


@dataclass(frozen=True, slots=True)
class Place:
    """Rows of the full image, and how many of its pixels one of the patch stands for each way.

    A coarse patch may reach beyond the lower and right edge of the image.
    """

    rows: Rows
    divisor: int


@dataclass(frozen=True, slots=True)
class Patch:
    """number: of its last change. pixels: (H, W, 4) float32, row 0 on top; None if the reader has them already."""

    place: Place
    number: int
    pixels: Image | None


class Canvas:
    """size: (width, height) of the full image. in_parts: whether it may be shown before all of its rows are there."""

    def __init__(self, size: tuple[int, int], in_parts: bool = True) -> None:
        self.size = size
        self._in_parts = in_parts
        self._lock = threading.Lock()
        self._images: dict[int, Image] = {}
        tiles = -(-size[1] // TILE_ROWS)
        self._divisors = [0] * tiles
        self._numbers = [0] * tiles
        self._whole = 0  # the divisor of the finest image that is whole; 0 before the first
        self._is_replaced = False
        self.has_image = threading.Event()
        """Set as soon as there is anything to show."""
        self.number = 0
        """Of the last change that shows; 0 as long as there is nothing."""

    def put_coarse(self, image: Image, divisor: int, rows: Rows, is_whole: bool) -> None:
        """A coarse image, in which only some rows of the full one are valid. is_whole: whether there are no others."""
        with self._lock:
            self._images[divisor] = image
            if is_whole:
                self._whole = divisor
            self._note(rows, divisor)

    def add_samples(
        self,
        made: Image,
        rows: Rows,
        done: int,
        count: int,
        is_whole: bool,
        pixels: Pixels | None = None,
        noise: Image | None = None,
    ) -> None:
        """`count` samples of rows of the full image, which have `done` already.

        is_whole: now all rows have them. pixels: which of the full image have got them, None for all of those rows.
        noise: of the full image, see `perfect_bvh.render_progressively`.
        """
        from perfect_bvh.render import add_samples

        part = slice(*rows)
        with self._lock:
            film = self._images.setdefault(0, np.zeros_like(made))  # 0: of the samples, whatever is shown
            if done == 0:
                film[part] = made[part]
            else:
                got = None if pixels is None else pixels[part]
                add_samples(film[part], made[part], done, count, got, None if noise is None else noise[part])
            if is_whole:
                self._whole = 1
            if self._is_replaced:
                return
            self._images[1] = film
            if self._in_parts:
                self._note(rows, 1)
            elif is_whole:
                self._note((0, self.size[1]), 1)

    def replace(self, image: Image) -> None:
        """Shows another full image instead, a denoised one; samples are added without being shown from now on."""
        with self._lock:
            self._is_replaced = True
            self._images[1] = image
            self._whole = 1
            self._note((0, self.size[1]), 1)

    def show_samples(self) -> None:
        """Shows the samples again instead of what has replaced them."""
        with self._lock:
            self._is_replaced = False
            self._images[1] = self._images[0]
            self._note((0, self.size[1]), 1)

    @property
    def is_replaced(self) -> bool:
        """Whether something else is shown than the samples."""
        return self._is_replaced

    @property
    def film(self) -> Image:
        """The mean of all samples: (H, W, 4) float32, still being added to unless it is finished."""
        return self._images[0]

    @property
    def image(self) -> Image | None:
        """The best image that is whole, coarse as long as there is no other; None before the first."""
        return self._images[self._whole] if self._whole else None

    def patches(self, held: Mapping[Place, int]) -> list[Patch]:
        """All that is to be shown, as copies. held: what the reader has, with its numbers."""
        with self._lock:
            found = []
            for rows in self._runs():
                tiles = slice(rows[0] // TILE_ROWS, -(-rows[1] // TILE_ROWS))
                place = Place(rows, self._divisors[tiles.start])
                number = max(self._numbers[tiles])
                is_held = held.get(place) == number
                found.append(Patch(place, number, None if is_held else self._pixels(place)))
            return found

    def _note(self, rows: Rows, divisor: int) -> None:
        number = next(_numbers)
        for tile in range(rows[0] // TILE_ROWS, -(-rows[1] // TILE_ROWS)):
            self._divisors[tile] = divisor
            self._numbers[tile] = number
        self.number = number
        self.has_image.set()

    def _runs(self) -> list[Rows]:
        """Rows that are equally fine: full ones in strips."""
        found: list[Rows] = []
        start = 0
        for tile in range(1, len(self._divisors) + 1):
            is_end = tile == len(self._divisors) or self._divisors[tile] != self._divisors[start]
            is_strip = self._in_parts and self._divisors[start] == 1 and tile % STRIP_TILES == 0
            if is_end or is_strip:
                if self._divisors[start]:
                    found.append((start * TILE_ROWS, min(tile * TILE_ROWS, self.size[1])))
                start = tile
        return found

    def _pixels(self, place: Place) -> Image:
        first, end = place.rows
        divisor = place.divisor
        return self._images[divisor][first // divisor : -(-end // divisor)].copy()
