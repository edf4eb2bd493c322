"""The order in which the image of one view is traced: resolutions, bands of rows, samples. Pure logic; traces nothing.

A coarse image comes first, as fine as its time allows, then finer ones, and over those the full one in bands of
rows from the top. Finer ones delay the full image: unless that takes long, they get no more than a small
share of its time, and the half resolution covers as many of the last rows as that allows. Then samples follow in rounds
of 1, 2, 4, 8 ..., as `perfect_bvh.render_progressively` adds them, if requested. Does not depend on Blender.
"""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

Rows = tuple[int, int]

# Divisors of a coarse image's width and height. They divide TILE_ROWS, so that each ends where a tile does.
DIVISORS = (1, 2, 4, 8, 16, 32)
# Rows in a tile of the renderer: bands that end with one trace next to nothing twice.
TILE_ROWS = 32
# Of bands, while a smaller one would still fit: each has fixed costs, and traces a few rows around it.
FEWEST_ROWS = 2 * TILE_ROWS
# Of the pixels of one full sample, what coarse images may have together; where that takes longer, all they want.
COARSE_SHARE = 0.16
LONG_SECONDS = 4.0
# Before anything was measured: slow enough that the first image is not late on any machine.
FIRST_GUESS_SECONDS_PER_PIXEL = 1e-6


@dataclass(slots=True)
class Pace:
    """How long a sample of a pixel takes, measured as it goes; kept by a viewport from view to view."""

    seconds_per_pixel: float = FIRST_GUESS_SECONDS_PER_PIXEL

    def learn(self, seconds: float, pixel_samples: int) -> None:
        """Take a measurement in, the last ones counting most."""
        if pixel_samples > 0:
            self.seconds_per_pixel += 0.5 * (seconds / pixel_samples - self.seconds_per_pixel)

    def learn_from_stopped(self, seconds: float, pixel_samples: int) -> None:
        """Learns from a step that was stopped: it would have taken longer than `seconds`."""
        if seconds > self.seconds_per_pixel * pixel_samples:
            self.learn(seconds, pixel_samples)

    def pixel_samples_in(self, seconds: float) -> int:
        """How many fit into `seconds`."""
        return int(seconds / max(self.seconds_per_pixel, 1e-12))

    def seconds_for(self, pixel_samples: int) -> float:
        """Estimates the time for this number of samples."""
        return pixel_samples * self.seconds_per_pixel


@dataclass(frozen=True, slots=True)
class Step:
    """A unit of tracing: `count` samples of some rows, counted from the top of the full image.

    divisor: one of its pixels covers this number of pixels of the full image each way.
    """

    divisor: int
    rows: Rows
    first_sample: int = 0
    count: int = 1


@dataclass(slots=True)
class Schedule:
    """The next step, and the finished part.

    columns: the number of pixels of a row. rows: of the full image, those to trace. samples: of each pixel.
    in_parts: whether parts of images are shown; if not, no coarse image covers a part alone.
    """

    columns: int
    rows: Rows
    samples: int
    in_parts: bool = True
    sample_count: int = 0
    """Samples that every pixel of the full image has, or needs no more of; 0 while there are but coarse ones."""
    _divisor: int = 0  # of the finest coarse image; 0 before the first
    _coarse_pixels: int = 0
    _row: int = field(init=False)  # from which on the round under way is still to be traced
    _columns_left: Sequence[int] = field(init=False)  # of each row of tiles: where samples are wanted

    def __post_init__(self) -> None:
        self._row = self.rows[0]
        self._columns_left = [self.columns] * -(-self.rows[1] // TILE_ROWS)

    @property
    def is_finished(self) -> bool:
        """Whether there is nothing left to trace."""
        if self.sample_count >= self.samples or self.rows[0] >= self.rows[1]:
            return True
        return self.sample_count > 0 and self._row == self.rows[0] and not any(self._columns_left)

    @property
    def progress(self) -> float:
        """The share done, 0 to 1: the samples of all rows, and the rows of the round under way."""
        if self.is_finished:
            return 1.0
        first, end = self.rows
        return (self.sample_count + self._round * (self._row - first) / (end - first)) / self.samples

    @property
    def _round(self) -> int:
        """Samples of the round under way: as many as there are."""
        return min(max(self.sample_count, 1), self.samples - self.sample_count)

    def next_step(self, pace: Pace, seconds: float) -> Step:
        """Returns the next step, of about `seconds` if possible: results that are ready sooner would not be seen."""
        step = None
        if self.sample_count == 0 and self._row == self.rows[0]:
            step = self._first_step(pace, seconds) if self._divisor == 0 else self._finer_step(pace, seconds)
        return step or self._band(pace, seconds)

    def note_done(self, step: Step) -> None:
        """A step that `next_step` gave was traced."""
        if step.divisor > 1:
            self._divisor = step.divisor
            self._coarse_pixels += self.pixels_of(step)
            return
        self._row = step.rows[1]
        if self._row >= self.rows[1]:
            self.sample_count += step.count
            self._row = self.rows[0]

    def note_left(self, columns: Sequence[int]) -> None:
        """Notes for each row of tiles of the full image, from its top, how many columns of pixels need more samples."""
        self._columns_left = columns

    def pixels_of(self, step: Step) -> int:
        """How many pixels it traces, each `step.count` times."""
        if step.divisor > 1:
            return self._pixels(step.divisor, step.rows)
        first, end = step.rows
        return sum(
            self._pixels_left(row, end) for row in (first, *range((first // TILE_ROWS + 1) * TILE_ROWS, end, TILE_ROWS))
        )

    def _pixels_left(self, row: int, end: int) -> int:
        """Counts the unfinished pixels of a row and those below it in its tiles, before `end`."""
        tile = row // TILE_ROWS
        return int(self._columns_left[tile]) * (min((tile + 1) * TILE_ROWS, end) - row)

    def _pixels(self, divisor: int, rows: Rows) -> int:
        return -(-self.columns // divisor) * -(-(rows[1] - rows[0]) // divisor)

    def _first_step(self, pace: Pace, seconds: float) -> Step | None:
        """The finest that fits: None if that is the full image."""
        fitting = pace.pixel_samples_in(seconds)
        fits = (divisor for divisor in DIVISORS if self._pixels(divisor, self.rows) <= fitting)
        divisor = next(fits, DIVISORS[-1])
        return None if divisor == 1 else Step(divisor, self.rows)

    def _finer_step(self, pace: Pace, seconds: float) -> Step | None:
        """Another coarse image, maybe of the last rows only; None if it is time for the full one."""
        whole = self._pixels(1, self.rows)
        is_long = pace.seconds_for(whole) > LONG_SECONDS or not self.in_parts
        budget = (whole if is_long else int(COARSE_SHARE * whole)) - self._coarse_pixels
        fitting = pace.pixel_samples_in(seconds)
        divisor = self._divisor // 2
        while divisor > 2 and self._pixels(divisor // 2, self.rows) <= min(fitting, budget):
            divisor //= 2
        if divisor < 2 or whole <= fitting:
            return None
        if self._pixels(divisor, self.rows) <= budget:
            return Step(divisor, self.rows)
        affordable = max(budget, 0) // -(-self.columns // divisor) * divisor
        first = -(-(self.rows[1] - affordable) // TILE_ROWS) * TILE_ROWS
        if not self.in_parts or self.rows[1] - first < FEWEST_ROWS:
            return None
        return Step(divisor, (first, self.rows[1]))

    def _band(self, pace: Pace, seconds: float) -> Step:
        """Rows of the round under way, to the end of a tile."""
        count = self._round
        bottom = self.rows[1]
        end = min((self._row + FEWEST_ROWS) // TILE_ROWS * TILE_ROWS, bottom)
        left = pace.pixel_samples_in(seconds) // count - self.pixels_of(Step(1, (self._row, end)))
        while end < bottom:
            more = self._pixels_left(end, bottom)
            if more > max(left, 0) and bottom - end >= TILE_ROWS:
                break
            left, end = left - more, min(end + TILE_ROWS, bottom)
        return Step(1, (self._row, end), self.sample_count, count)


# Throttle ------------------------------------------------------------------------------------------------------------
# Limit how often the growing image of a render is shown.


T = TypeVar("T")

SHOW_SECONDS = 0.5


class Throttle(Generic[T]):
    """Calls `show` with the first image, and then at most once every SHOW_SECONDS; drops the images between.

    Blender's main thread converts and draws the whole image for each call, and answers to nothing else until it has.
    """

    def __init__(self, show: Callable[[T], object], clock: Callable[[], float] = time.monotonic) -> None:
        self._show = show
        self._clock = clock
        self._next = float("-inf")

    def __call__(self, image: T) -> None:
        """Show `image`, unless the last one was shown less than SHOW_SECONDS ago, counted from the end of that call."""
        if self._clock() >= self._next:
            self._show(image)
            self._next = self._clock() + SHOW_SECONDS


# Canvas --------------------------------------------------------------------------------------------------------------
# The current state of an image that is being traced: fine rows over coarse ones, readable while it grows.
#
# One thread writes, another reads. Rows of the full image are stored by the renderer's tiles. For each tile's rows
# it stores their resolution and the time of their last change, so that a reader fetches only changed ones. Does not
# depend on Blender.


Image = npt.NDArray[np.float32]
Pixels = npt.NDArray[np.bool_]

# Full rows are read in bands of this number of tiles; the reader keeps unchanged bands.
STRIP_TILES = 4

# Numbers of changes, unique over all canvases.
_numbers = itertools.count(1)


@dataclass(frozen=True, slots=True)
class Place:
    """Rows of the full image, and the number of its pixels that a pixel of the patch covers each way.

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
            film = self._images.setdefault(0, np.zeros_like(made))  # 0: of the samples, even while others are shown
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
        """Shows the samples again instead of the image that has replaced them."""
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
        """Returns copies of all new patches. held: the reader's patches, with their numbers."""
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
