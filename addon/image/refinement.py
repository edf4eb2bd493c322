"""The image of one view until it is finished: the plan of `progressive.py` is traced, step by step.

Any thread may trace it, one at a time, while another reads the current image: a view holds nothing of Blender. The
result is bit for bit that of `perfect_bvh.render_progressively` in one go. Does not depend on Blender.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..support.background_work import BackgroundWork
from .denoising import ImageDenoiser
from .plan import GUIDES, NOISY, trace_costs
from .progressive import Canvas, Image, Pace, Pixels, Schedule, Step
from .still import Images

if TYPE_CHECKING:
    from perfect_bvh import Appearance, Camera, Snapshot, StopFlag

    from ..live.scene_sync import SceneSync
    from .plan import RenderPlan


# A step that is stopped is lost, so the next ones are shorter: an image that is stopped again and again gets done, too.
SHORTEST_SECONDS = 0.03
DEFAULT_INTERVAL = 0.1
COARSEST_DENOISED = 4  # pixels that one of a coarse image covers each way


@dataclass(frozen=True, slots=True)
class View:
    """The content of an image, and all that it depends on."""

    snapshot: Snapshot
    appearance: Appearance
    camera: Camera
    plan: RenderPlan

    @staticmethod
    def of(sync: SceneSync, camera: Camera, plan: RenderPlan) -> View:
        """Makes the view of a sync that is up to date."""
        return View(sync.scene.snapshot(), sync.appearance, camera, plan)


class Refinement:
    """canvas: the current image. view: its content.

    seconds, ray_count: the time of tracing so far, and its number of camera rays. costs: once it is
    finished, the result of `trace_costs`. is_finished: whether all steps are done.

    If the plan says so, images are shown denoised: coarse ones except the coarsest, the full one as soon
    as it is complete, and again whenever its samples have doubled. complaint: why that does not work as it should, as a
    sentence for the user.
    """

    def __init__(self, view: View, pace: Pace, clock: Callable[[], float] = time.perf_counter) -> None:
        self.view = view
        self.seconds = 0.0
        self.ray_count = 0
        self.costs: Images | None = None  # of the camera's rays; None before the first full image
        self.is_finished = False
        self.interval = DEFAULT_INTERVAL
        """The time until something new can be shown, for the tracing code: shorter steps would only cost more."""
        self.complaint: str | None = None
        self._denoiser = ImageDenoiser(view.plan) if view.plan.is_denoised else None
        self._denoised_count = 0  # of how many samples the image was that was denoised last
        self._guides: Images = {}
        self._noise: Images = {}  # of the image and the denoiser's input, from the second round of samples on
        self._pace = pace
        self._clock = clock
        self._longest = float("inf")
        width, height = view.plan.size
        left, right = _columns_of(view.camera, width)
        _, _, bottom, top = view.camera.border
        rows = (height - int(np.float32(top) * height), height - int(np.float32(bottom) * height))
        in_parts = not view.plan.mode.has_range  # greys are between the least and the greatest
        self._schedule = Schedule(max(1, right - left), rows, view.plan.samples, in_parts)
        self.canvas = Canvas(view.plan.size, in_parts)
        self._sampling = view.plan.make_sampling()
        if self._sampling is not None:
            self._sampling.keep_within(view.camera.border)

    @property
    def image(self) -> Image | None:
        """The best whole image there is: (H, W, 4) float32 scene-linear, row 0 on top; coarse at first, None before."""
        return self.canvas.image

    @property
    def sample_count(self) -> int:
        """Samples that every pixel of the image has, or needs no more of; 0 while it is coarse."""
        return self._schedule.sample_count

    @property
    def mean_samples(self) -> float:
        """Samples of a pixel, on average."""
        return self.sample_count if self._sampling is None else self._sampling.mean_samples

    @property
    def progress(self) -> float:
        """The share done, 0 to 1."""
        return self._schedule.progress

    def step(self, seconds: float, stop: StopFlag | None = None) -> bool:
        """Work for about `seconds`; whether the whole image has become better.

        stop: ends it with `perfect_bvh.Cancelled`; the results of earlier steps stay.
        """
        if self.is_finished:
            return False
        if self._denoiser is not None and self._is_worth_denoising:
            self._denoise(self._denoiser, stop)
            return True
        if self.costs is None and (self.sample_count > 0 or self._schedule.is_finished):
            self._find_costs(stop)
            return False
        if self._schedule.is_finished:
            self._finish()
            return False
        step = self._schedule.next_step(self._pace, min(seconds, self._longest))
        is_whole = step.rows[1] >= self._schedule.rows[1]
        if step.divisor > 1:
            return self._add_coarse(step, stop)
        self._add_samples(step, self._trace(step, stop)["combined"], is_whole)
        self._schedule.note_done(step)
        return is_whole or step.first_sample > 0

    def _add_coarse(self, step: Step, stop: StopFlag | None) -> bool:
        is_whole = step.rows == self._schedule.rows
        passes = self._trace(step, stop)
        self.canvas.put_coarse(passes["combined"], step.divisor, step.rows, is_whole)
        self._schedule.note_done(step)
        if self._denoiser is not None and self._denoises(step):
            part = slice(step.rows[0] // step.divisor, -(-step.rows[1] // step.divisor))
            made = passes["combined"].copy()
            made[part] = self._denoiser.denoise_coarse({name: passes[name][part] for name in passes}, stop)
            self.canvas.put_coarse(made, step.divisor, step.rows, is_whole)
        return is_whole

    def _denoises(self, step: Step) -> bool:
        """The coarsest image is soon replaced, and all that there is of a scene in motion: it waits for nothing."""
        return self._denoiser is not None and step.divisor <= COARSEST_DENOISED

    def _add_samples(self, step: Step, made: Image, is_whole: bool) -> None:
        pixels, sampling, done = self._pixels, self._sampling, step.first_sample
        if sampling is not None:
            sampling.note_round(made if done == 0 else self.canvas.film, made, done, step.count, step.rows)
            self._schedule.note_left(sampling.columns_left.tolist())
        noise = self._noise_of("combined", made) if self._denoiser is not None else None
        self.canvas.add_samples(made, step.rows, done, step.count, is_whole, pixels, noise)

    @property
    def _pixels(self) -> Pixels | None:
        """The pixels of the full image that get more samples; None for all."""
        return None if self._sampling is None else self._sampling.pixels()

    def _trace(self, step: Step, stop: StopFlag | None) -> Images:
        import perfect_bvh
        from perfect_bvh.render import add_samples

        view = self.view
        camera, size = _seen_by(step, view.camera, view.plan.size)
        count = self._schedule.pixels_of(step) * step.count
        guides = GUIDES if self._denoises(step) else ()
        tiles = None if self._sampling is None or step.divisor > 1 else self._sampling.tiles
        started = self._clock()
        try:
            passes = perfect_bvh.render_passes(
                view.snapshot,
                camera,
                mode=view.plan.settings.mode,  # type: ignore[arg-type]
                size=size,
                samples=step.count,
                appearance=view.appearance,
                passes=("combined", *guides),
                progress=stop,
                first_sample=step.first_sample,
                is_continued=step.divisor == 1 and view.plan.samples > 1,
                tiles=tiles,
                **view.plan.options,
            )
        except perfect_bvh.Cancelled:
            seconds = self._clock() - started
            self._pace.learn_from_stopped(seconds, count)
            self._longest = max(SHORTEST_SECONDS, 0.5 * min(self._longest, self._pace.seconds_for(count)))
            raise
        seconds = self._clock() - started
        self._longest *= 2.0
        self._pace.learn(seconds, count)
        self.seconds += seconds
        self.ray_count += count
        part = slice(*step.rows)
        pixels = None if tiles is None else self._pixels[part]
        for name in guides if step.divisor == 1 else ():
            blended = self._guides.setdefault(name, np.zeros_like(passes[name]))[part]
            noise = self._noise_of(name, passes[name])[part] if name == NOISY and step.first_sample else None
            add_samples(blended, passes[name][part], step.first_sample, step.count, pixels, noise)
        return passes

    def _noise_of(self, name: str, like: Image) -> Image:
        noise: Image = self._noise.setdefault(name, np.zeros_like(like))
        return noise

    @property
    def _is_worth_denoising(self) -> bool:
        """Whether the samples have doubled since the last time, or there will be no more."""
        count, before = self.sample_count, self._denoised_count
        return count >= max(2 * before, 1) or (self._schedule.is_finished and count > before)

    def _denoise(self, denoiser: ImageDenoiser, stop: StopFlag | None) -> None:
        noise = self._noise if self.sample_count > 1 else None
        made = denoiser.denoise({"combined": self.canvas.film, **self._guides}, noise, stop)
        self._denoised_count, self.complaint = self.sample_count, made.complaint
        if made.name is None:
            self._denoiser = None  # it would fail with the next samples, too
            self.canvas.show_samples()
        else:
            self.canvas.replace(made.image)

    def _find_costs(self, stop: StopFlag | None) -> None:
        view = self.view
        self.costs = trace_costs(
            view.snapshot, view.camera, view.plan.size, view.appearance, view.plan.settings.threads, stop
        )

    def _finish(self) -> None:
        width, height = self.view.plan.size
        if self.canvas.image is None:  # not a row lies within the border
            self.canvas.replace(np.zeros((height, width, 4), np.float32))
        self.is_finished = True


def _seen_by(step: Step, camera: Camera, size: tuple[int, int]) -> tuple[Camera, tuple[int, int]]:
    """Returns the camera of a step, and the size of its image.

    A coarse pixel covers exactly `divisor` pixels each way, so that coarse and full rows fit together: the coarse image
    reaches as far beyond the lower and right edge as that takes.
    """
    width, height = size
    divisor = step.divisor
    columns, rows = -(-width // divisor), -(-height // divisor)
    wider, higher = columns * divisor / width, rows * divisor / height
    left, right, bottom, top = camera.window
    window = (left, left + (right - left) * wider, top - (top - bottom) * higher, top)
    # The renderer truncates: half a pixel more keeps each edge on its row and column.
    first, end = step.rows[0] // divisor, -(-step.rows[1] // divisor)
    below, above = (rows - end + 0.5) / rows, min((rows - first + 0.5) / rows, 1.0)
    first, end = _columns_of(camera, width)
    first, end = first // divisor, -(-end // divisor)
    before, behind = (first + 0.5) / columns, min((end + 0.5) / columns, 1.0)
    border = (before if first else 0.0, behind, below if step.rows[1] < height else 0.0, above)
    return replace(camera, window=camera.window if divisor == 1 else window, border=border), (columns, rows)


def _columns_of(camera: Camera, width: int) -> tuple[int, int]:
    """Returns the columns within the border, as the renderer rounds."""
    left, right, _, _ = camera.border
    return int(np.float32(left) * width), int(np.float32(right) * width)


# Tracer --------------------------------------------------------------------------------------------------------------
# Refines one image after the other on a separate thread, which exists only while there is something to trace.
#
# Its images hold nothing of Blender, so Blender continues during the tracing, and may edit the scene. All
# methods are for one thread, except `stop`, which is for any.


# The first image of a view is awaited: it is made so coarse that it is there at once.
FIRST_SECONDS = 0.03
LOOKING_SECONDS = 0.05


class Tracer:
    """Works on nothing at first. It keeps no thread alive, and a thread does not keep it."""

    def __init__(self) -> None:
        self._refinement: Refinement | None = None
        self._work: BackgroundWork[None, None] | None = None
        self._stop: StopFlag | None = None

    def trace(self, refinement: Refinement) -> None:
        """Go on with an image until it is finished or `stop`, and with no other; does nothing if that is so already."""
        import perfect_bvh

        if self._refinement is refinement and self._work is not None and (self.is_running or self.problem is not None):
            return
        self.stop()
        before, stop = self._work, perfect_bvh.make_stop_flag()
        self._refinement, self._stop = refinement, stop
        self._work = BackgroundWork(
            lambda _: _trace(refinement, stop, before), finish=lambda _: None, when_stopped=stop.set
        )

    def stop(self) -> None:
        """Stop tracing, from any thread, without waiting. The part that was traced stays in the image."""
        work = self._work
        if work is not None:
            work.ask_to_stop()

    def end(self) -> None:
        """Stop, and wait for that."""
        self.stop()
        if self._work is not None:
            self._work.settle()

    def wait_for_image(self, seconds: float = math.inf) -> None:
        """Wait until there is anything to show or nothing is traced, at most `seconds`."""
        refinement, until = self._refinement, time.monotonic() + seconds
        while refinement is not None and self.is_running:
            left = min(until - time.monotonic(), LOOKING_SECONDS)
            if left <= 0.0 or refinement.canvas.has_image.wait(left):
                return

    @property
    def is_running(self) -> bool:
        """Whether it is at work, and was not asked to stop."""
        return self._work is not None and self._work.is_running and self._work.is_wanted

    @property
    def problem(self) -> BaseException | None:
        """Why the image is not traced any further, if it should be."""
        if self._work is None or self._work.is_running:
            return None
        try:
            self._work.result()
        except Exception as problem:  # noqa: BLE001 - handed on
            return problem
        return None


def _trace(refinement: Refinement, stop: StopFlag, before: BackgroundWork[None, None] | None) -> None:
    """Runs on the thread. before: work that must end first."""
    import perfect_bvh

    if before is not None:
        before.settle()
    before = None
    try:
        while not refinement.is_finished and not stop.is_set:
            has_image = refinement.canvas.has_image.is_set()
            refinement.step(refinement.interval if has_image else FIRST_SECONDS, stop)
    except perfect_bvh.Cancelled:
        return  # not raised again: the exception would keep all frames of its traceback alive
