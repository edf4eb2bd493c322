"""In which order the image of one view is traced: resolutions, bands of rows, samples. Pure logic; traces nothing.

A coarse image comes first, as fine as the time for it allows, then finer ones, and over those the full one in bands of
rows from the top. Finer ones cost time that the full image wants: unless that takes long, they get no more than a small
share of it, and the half resolution covers the rows that come last, as far as that goes. Then samples follow in rounds
of 1, 2, 4, 8 ..., as `perfect_bvh.render_progressively` adds them, where they are wanted. Knows no Blender.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

Rows = tuple[int, int]

# A coarse image has so many pixels less on each side. They divide TILE_ROWS, so that each ends where a tile does.
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
        """Of what was stopped before its end: it would have taken longer than that."""
        if seconds > self.seconds_per_pixel * pixel_samples:
            self.learn(seconds, pixel_samples)

    def pixel_samples_in(self, seconds: float) -> int:
        """How many fit into `seconds`."""
        return int(seconds / max(self.seconds_per_pixel, 1e-12))

    def seconds_for(self, pixel_samples: int) -> float:
        """How long so many take."""
        return pixel_samples * self.seconds_per_pixel


@dataclass(frozen=True, slots=True)
class Step:
    """What is traced in one go: `count` samples of some rows, counted from the top of the full image.

    divisor: one pixel of it stands for so many of the full image each way.
    """

    divisor: int
    rows: Rows
    first_sample: int = 0
    count: int = 1


@dataclass(slots=True)
class Schedule:
    """What comes next, and what is done.

    columns: how many pixels a row has. rows: of the full image, those to trace. samples: of each pixel.
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

    def next_step(self, pace: Pace, seconds: float) -> Step:
        """What to trace next, of about `seconds` if that is possible: what is ready sooner is not seen."""
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
        """In how many columns of pixels each row of tiles of the full image, from its top, wants more samples."""
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
        """Of a row and those below it in its tiles, before `end`."""
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
        count = min(max(self.sample_count, 1), self.samples - self.sample_count)
        bottom = self.rows[1]
        end = min((self._row + FEWEST_ROWS) // TILE_ROWS * TILE_ROWS, bottom)
        left = pace.pixel_samples_in(seconds) // count - self.pixels_of(Step(1, (self._row, end)))
        while end < bottom:
            more = self._pixels_left(end, bottom)
            if more > max(left, 0) and bottom - end >= TILE_ROWS:
                break
            left, end = left - more, min(end + TILE_ROWS, bottom)
        return Step(1, (self._row, end), self.sample_count, count)
