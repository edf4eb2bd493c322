"""`perfect-bvh render`: frames of a file, one after the other, into images."""

from __future__ import annotations

import argparse
import functools
import operator
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from . import EXIT_INTERRUPTED
from .arguments import CommandError, Output, check_blend_file, check_mode
from .blender import (
    StopRequest,
    active_view_layer,
    apply_settings,
    go_to_frame,
    open_scene,
    render_job,
    stop_on_interrupt,
)
from .console import quiet_blender
from .ignored_output import find_ignored_output
from .report import FrameTimes, format_frame, format_header, format_summary

if TYPE_CHECKING:
    import bpy
    import numpy as np
    import numpy.typing as npt
    from perfect_bvh import Audit
    from tqdm import tqdm

    from ..image.still import Frame
    from ..settings.modes import Mode
    from ..sync.report import SyncReport


def run_render(arguments: argparse.Namespace) -> int:
    """Render what the arguments say; the exit status."""
    check_mode(arguments.mode)
    path = check_blend_file(arguments.file)
    output = Output.parse(arguments.output, len(arguments.frames or (0,)))
    output.check_frames(arguments.frames or (0,), path)
    output.prepare()
    with quiet_blender() as out, stop_on_interrupt() as stop:
        scene = open_scene(path, arguments)
        if scene.camera is None:
            raise CommandError(f"{arguments.file}: scene {scene.name!r} has no camera")
        for sentence in find_ignored_output(scene, active_view_layer(scene)):
            sys.stderr.write(f"perfect-bvh: {sentence}\n")
        apply_settings(scene, arguments)
        frames = arguments.frames or (scene.frame_current,)
        output.check_frames(frames, path)
        session = RenderSession(scene, output, out, stop, arguments)
        return session.run(frames)


class RenderSession:
    """One run over some frames: progress bar, files, what was learnt on the way."""

    def __init__(
        self, scene: bpy.types.Scene, output: Output, out: TextIO, stop: StopRequest, arguments: argparse.Namespace
    ) -> None:
        from ..extract.libraries import find_missing_libraries
        from ..settings.modes import find_mode

        self._scene = scene
        self._output = output
        self._out = out
        self._stop = stop
        self._wants_stats: bool = arguments.stats
        self._is_quiet: bool = arguments.quiet
        self._mode: Mode = find_mode(scene.perfect_bvh.mode.lower())
        self._range: tuple[float, float] | None = None
        self._times: list[FrameTimes] = []
        self._reports: list[SyncReport] = []
        self._warned = {str(row) for row in find_missing_libraries()}  # told when the file was opened
        self._audits: list[Audit] = []

    def run(self, frames: tuple[int, ...]) -> int:
        """Render them all; the exit status."""
        from tqdm import tqdm

        bar_format = "{l_bar}{bar}| {n:.3g}/{total} [{elapsed}<{remaining}]"
        # None: shown on a terminal only, so that logs stay clean.
        is_disabled = True if self._is_quiet else None
        if self._wants_stats:
            self._say(format_header())
        with tqdm(
            total=len(frames), unit="frame", bar_format=bar_format, disable=is_disabled, leave=False, file=sys.stderr
        ) as bar:
            for index, frame in enumerate(frames):
                bar.set_description(f"frame {frame}")
                if self._stop.is_set or not self._render(frame, index, bar):
                    break
                bar.update(index + 1 - bar.n)
        return self._finish(frames)

    def _render(self, number: int, index: int, bar: tqdm) -> bool:
        """Render and write one frame; False if it was stopped."""
        from ..engine import RenderJob

        def advance(done: float) -> bool:
            bar.update(index + done - bar.n)
            return not self._stop.is_set

        start = time.perf_counter()
        go_to_frame(self._scene, number)
        job = RenderJob(progress=advance)
        render_job(self._scene, job)
        if job.is_cancelled:
            return False
        if job.frame is None:
            raise CommandError(f"frame {number}: the engine gave no image")
        rendered = time.perf_counter()
        self._save(self._output.path_of(number), job.frame)
        end = time.perf_counter()
        times = FrameTimes.of(job.frame.statistics, total=end - start, save=end - rendered)
        self._times.append(times)
        self._reports.append(job.frame.statistics.report)
        if job.frame.statistics.audit is not None:
            self._audits.append(job.frame.statistics.audit)
        self._warn(job.frame)
        if self._wants_stats:
            self._say(format_frame(number, job.frame.statistics, times))
        return True

    def _save(self, path: Path, frame: Frame) -> None:
        from ..image.saving import save_image

        image = frame.images["combined"]
        if self._mode.has_range and path.suffix.lower() != ".exr":
            image = self._grey(frame)
        try:
            save_image(path, frame.cut(image), self._scene, self._mode)
        except OSError as error:
            raise CommandError(error.strerror or str(error)) from error

    def _grey(self, frame: Frame) -> npt.NDArray[np.float32]:
        """Distances as greys, near white and far black, on one scale for the whole animation: the first frame's."""
        import numpy as np
        from perfect_bvh.render import NO_DEPTH, depth_to_grey

        image = frame.images["combined"]
        distances = image[..., 0]
        if self._range is None:
            hit = distances[(distances > 0.0) & (distances < NO_DEPTH)]  # what lies outside of a border has none
            self._range = (float(hit.min()), float(hit.max())) if hit.size else (0.0, 1.0)
        greys = depth_to_grey(distances, *self._range)
        return np.stack([greys, greys, greys, image[..., 3]], axis=-1)

    def _warn(self, frame: Frame) -> None:
        report = frame.statistics.report
        for warning in (*report.warnings, *map(str, report.not_shown), *frame.statistics.complaints):
            if warning not in self._warned:
                self._warned.add(warning)
                self._complain(warning)

    def _say(self, text: str) -> None:
        from tqdm import tqdm

        tqdm.write(text, file=self._out)
        self._out.flush()

    def _complain(self, text: str) -> None:
        from tqdm import tqdm

        tqdm.write(f"perfect-bvh: {text}", file=sys.stderr)

    def _finish(self, frames: tuple[int, ...]) -> int:
        if self._times and not self._is_quiet:
            self._say(self._summary(frames))
        if len(self._times) < len(frames):
            sys.stderr.write(f"perfect-bvh: stopped; {len(self._times)} of {len(frames)} frames are written\n")
            return EXIT_INTERRUPTED
        return 0

    def _summary(self, frames: tuple[int, ...]) -> str:
        lines = [format_summary(self._reports, self._times, self._output.describe(frames[: len(self._times)]))]
        if self._audits:
            lines.append(f"audit: {functools.reduce(operator.add, self._audits)}")
        if self._range is not None:
            lines.append(f"grey scale: white at {self._range[0]:g}, black at {self._range[1]:g}")
        return "\n".join(lines)
