"""One view, refined step by step: a coarse image at once, then sample after sample, never more work than asked for.

A viewport has a few hundredths of a second for each redraw. So the first image has as few pixels as fit, and the full
one is traced in bands of rows, as many for each step as its time allows. What comes out in the end is bit for bit what
`perfect_bvh.render_progressively` makes in one go. Knows no Blender.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from perfect_bvh import Appearance, Camera, Snapshot

    from ..live.scene_sync import SceneSync
    from .plan import RenderPlan

Image = npt.NDArray[np.float32]

# A coarse image has this many pixels less on each side.
COARSE_STEPS = (1, 2, 3, 4, 6, 8)
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

    def pixel_samples_in(self, seconds: float) -> int:
        """How many fit into `seconds`."""
        return int(seconds / max(self.seconds_per_pixel, 1e-12))


@dataclass(frozen=True, slots=True)
class View:
    """What an image shows, and all that it depends on."""

    snapshot: Snapshot
    appearance: Appearance
    camera: Camera
    plan: RenderPlan

    @staticmethod
    def of(sync: SceneSync, camera: Camera, plan: RenderPlan) -> View:
        """Of what a sync that is in step holds."""
        return View(sync.scene.snapshot(), sync.appearance, camera, plan)


class Refinement:
    """The image of one view on its way to being finished.

    image: (H, W, 4) float32 scene-linear, row 0 on top: the best there is, coarse at first, None before the first step.
    view: what it shows. sample_count: samples that every pixel of it has; 0 while it is coarse.
    seconds, ray_count: what tracing it has taken so far, and how many camera rays that were.
    """

    def __init__(self, view: View, pace: Pace, clock: Callable[[], float] = time.perf_counter) -> None:
        self.image: Image | None = None
        self.sample_count = 0
        self.seconds = 0.0
        self.ray_count = 0
        self.view = view
        self._pace = pace
        self._clock = clock
        self._film: Image | None = None
        self._row_count = 0  # of the round under way
        width, height = view.plan.size
        left, right, bottom, top = view.camera.border
        self._rows = (height - int(np.float32(top) * height), height - int(np.float32(bottom) * height))
        self._columns = max(1, round((right - left) * width))

    @property
    def is_finished(self) -> bool:
        """Whether there is nothing left to do."""
        return self.sample_count >= self.view.plan.samples

    @property
    def progress(self) -> float:
        """The share done, 0 to 1."""
        return self.sample_count / self.view.plan.samples

    def step(self, seconds: float) -> bool:
        """Work for about `seconds`; whether the image has become better. The first step always makes an image."""
        if self.is_finished:
            return False
        if self.image is None:
            divisor = self._coarse_divisor(seconds)
            if divisor > 1:
                self.image = self._trace_coarse(divisor)
                return True
        return self._advance(seconds)

    def _coarse_divisor(self, seconds: float) -> int:
        width, height = self.view.plan.size
        fitting = self._pace.pixel_samples_in(seconds)
        for divisor in COARSE_STEPS:
            if (width // divisor) * (height // divisor) <= fitting:
                return divisor
        return COARSE_STEPS[-1]

    def _trace_coarse(self, divisor: int) -> Image:
        width, height = self.view.plan.size
        return self._trace((max(1, width // divisor), max(1, height // divisor)), self.view.camera, 0, 1)

    def _advance(self, seconds: float) -> bool:
        """Bands of the round under way, at least one; whether the image has changed."""
        deadline = self._clock() + seconds
        top, bottom = self._rows
        first_row = top + self._row_count
        count = self._round_samples()
        while True:
            wanted = self._pace.pixel_samples_in(deadline - self._clock()) // (self._columns * count)
            end_row = min(bottom, first_row + max(wanted, 8))
            self._trace_band(first_row, end_row, count)
            first_row = end_row
            if first_row >= bottom:
                self._row_count = 0
                self.sample_count += count
                self.image = self._film
                return True
            self._row_count = first_row - top
            if self._clock() >= deadline:
                # A round over the finished first one shows as it goes; a half-traced first one does not.
                return self.sample_count > 0

    def _round_samples(self) -> int:
        """1, 1, 2, 4, 8 ...: as `render_progressively` does it."""
        return min(max(self.sample_count, 1), self.view.plan.samples - self.sample_count)

    def _trace_band(self, first_row: int, end_row: int, count: int) -> None:
        """Add `count` samples to the film's rows from first_row to before end_row, counted from the top."""
        width, height = self.view.plan.size
        left, right, _, _ = self.view.camera.border
        # The renderer truncates: half a pixel more keeps each edge on its row.
        bottom, top = (height - end_row + 0.5) / height, min((height - first_row + 0.5) / height, 1.0)
        camera = replace(self.view.camera, border=(left, right, 0.0 if end_row == height else bottom, top))
        made = self._trace((width, height), camera, self.sample_count, count)
        if self._film is None:
            self._film = np.zeros_like(made)
        rows = slice(first_row, end_row)
        if self.sample_count == 0:
            self._film[rows] = made[rows]
        else:
            weight = np.float32(count / (self.sample_count + count))
            self._film[rows] += (made[rows] - self._film[rows]) * weight

    def _trace(self, size: tuple[int, int], camera: Camera, first_sample: int, count: int) -> Image:
        import perfect_bvh

        view = self.view
        started = self._clock()
        image = perfect_bvh.render(
            view.snapshot,
            camera,
            view.plan.settings.mode,  # type: ignore[arg-type]
            size,
            count,
            view.appearance,
            first_sample=first_sample,
            **view.plan.options,
        )
        left, right, bottom, top = camera.border
        seconds, rays = self._clock() - started, int((right - left) * size[0] * (top - bottom) * size[1] * count)
        self._pace.learn(seconds, rays)
        self.seconds += seconds
        self.ray_count += rays
        return image
