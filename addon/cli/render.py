"""`perfect-bvh render`: frames of a file, one after the other, into images."""

from __future__ import annotations

import argparse
import functools
import operator
import sys
import time
from typing import TYPE_CHECKING, TextIO

from .arguments import (
    EXIT_INTERRUPTED,
    CommandError,
    Output,
    check_blend_file,
    check_mode,
    check_pieces,
    find_ignored_output,
)
from .blender import StopRequest, active_view_layer, apply_settings, open_scene, stop_on_interrupt
from .frames import ImageWriter, RenderWork, render_frame, run_pieces
from .report import FrameTimes, Teller, format_frame, format_header, format_summary, progress_bar, quiet_blender

if TYPE_CHECKING:
    import bpy
    from perfect_bvh import Audit
    from tqdm import tqdm

    from ..sync.report import SyncReport


def run_render(arguments: argparse.Namespace) -> int:
    """Render as the arguments say; returns the exit status."""
    from ..extract.camera import has_camera

    check_mode(arguments.mode)
    if arguments.piece is not None and not _is_in_pieces(arguments):
        raise CommandError("--chunk needs --resume, --workers or --scheduler; without them there are no chunks")
    check_pieces(arguments)
    if _is_in_pieces(arguments) and (arguments.stats or arguments.audit is not None):
        raise CommandError("--stats and --audit cannot be combined with --resume, --workers or --scheduler")
    path = check_blend_file(arguments.file)
    output = Output.parse(arguments.output, len(arguments.frames or (0,)))
    output.check_frames(arguments.frames or (0,), path)
    output.prepare()
    arguments.file, arguments.output = str(path), str(output.pattern)  # as workers, which are elsewhere, find them
    with quiet_blender() as out, stop_on_interrupt() as stop:
        scene = open_scene(path, arguments)
        if not has_camera(scene):
            raise CommandError(f"{arguments.file}: scene {scene.name!r} has no camera")
        for sentence in find_ignored_output(scene, active_view_layer(scene)):
            sys.stderr.write(f"perfect-bvh: {sentence}\n")
        if _is_in_pieces(arguments):
            return run_pieces(RenderWork, scene, stop, arguments, out)
        apply_settings(scene, arguments)
        frames = arguments.frames or (scene.frame_current,)
        output.check_frames(frames, path)
        session = RenderSession(scene, output, out, stop, arguments)
        return session.run(frames)


def _is_in_pieces(arguments: argparse.Namespace) -> bool:
    return bool(arguments.resume or arguments.workers or arguments.scheduler)


class RenderSession:
    """One run over some frames: progress bar, files, and measurements for later frames."""

    def __init__(
        self, scene: bpy.types.Scene, output: Output, out: TextIO, stop: StopRequest, arguments: argparse.Namespace
    ) -> None:
        from ..extract.label_values import find_missing_libraries
        from ..extract.scene_in_time import has_simulations
        from ..live.scene_view import SceneView

        self._view = SceneView("render", scene, active_view_layer(scene), for_viewport=arguments.viewport)
        self._output = output
        self._out = out
        self._stop = stop
        self._wants_stats: bool = arguments.stats
        self._is_quiet: bool = arguments.quiet
        self._writer = ImageWriter(scene)
        self._is_simulated = has_simulations(scene)
        self._times: list[FrameTimes] = []
        self._reports: list[SyncReport] = []
        self._teller = Teller({str(row) for row in find_missing_libraries()})  # reported when the file was opened
        self._audits: list[Audit] = []

    def run(self, frames: tuple[int, ...]) -> int:
        """Render them all; the exit status."""
        if self._wants_stats:
            self._say(format_header())
        with progress_bar("frame", len(frames), self._is_quiet) as bar:
            for index, frame in enumerate(frames):
                bar.set_description(f"frame {frame}")
                if self._stop.is_set or not self._render(frame, index, bar):
                    break
                bar.update(index + 1 - bar.n)
        return self._finish(frames)

    def _render(self, number: int, index: int, bar: tqdm) -> bool:
        """Render and write one frame; False if it was stopped."""

        def advance(done: float) -> bool:
            bar.update(index + done - bar.n)
            return not self._stop.is_set

        start = time.perf_counter()
        frame = render_frame(self._view, number, advance, self._is_simulated)
        if frame is None:
            return False
        rendered = time.perf_counter()
        self._writer.save(self._output.path_of(number), frame)
        end = time.perf_counter()
        times = FrameTimes.of(frame.statistics, total=end - start, save=end - rendered)
        self._times.append(times)
        self._reports.append(frame.statistics.report)
        if frame.statistics.audit is not None:
            self._audits.append(frame.statistics.audit)
        from ..image.still import warnings_of

        self._teller.tell(warnings_of(frame))
        if self._wants_stats:
            self._say(format_frame(number, frame.statistics, times))
        return True

    def _say(self, text: str) -> None:
        from tqdm import tqdm

        tqdm.write(text, file=self._out)
        self._out.flush()

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
        if self._writer.range is not None:
            near, far = self._writer.range
            lines.append(f"grey scale: white at {near:g}, black at {far:g}")
        return "\n".join(lines)
