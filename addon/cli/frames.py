"""Frames of a file, rendered and written as images, on one scale of greys where there is one; also in chunks."""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TextIO, TypeVar

from ..pieces.work import Advance, Done, Outcome, PieceWork, Steps, do_pieces
from .arguments import EXIT_FAILED_PIECES, EXIT_INTERRUPTED, CommandError, Output, explained
from .blender import StopRequest, active_view_layer, apply_settings
from .report import Teller, is_reader_gone, progress_bar

if TYPE_CHECKING:
    import bpy
    import numpy as np
    import numpy.typing as npt

    from ..image.still import Frame
    from ..live.scene_view import SceneView
    from ..pieces.piece import Piece


T = TypeVar("T")
# What images depend on, among the arguments.
CHOICES = ("mode", "size", "samples", "denoise", "time_limit", "noise_threshold", "seed", "viewport")


def render_frame(
    view: SceneView, number: int, progress: Callable[[float], bool], is_simulated: bool = False
) -> Frame | None:
    """Plans, reads and traces a frame of a scene; None if it was stopped. Errors: CommandError.

    progress: called with 0 to 1; False stops. is_simulated: whether the frame depends on those before.
    """
    import perfect_bvh

    from ..image import still
    from ..image.plan import plan_layer
    from ..live.scene_view import SceneMoment, go_to_frame
    from ..live.sync_cache import sync_of
    from ..statistics.words import reason_of, sentence

    def render(moment: SceneMoment) -> Frame:
        plan, graph = plan_layer(moment.depsgraph), moment.depsgraph
        plan.check_memory()
        if moment.camera is None:
            raise ValueError(f"scene {moment.scene.name!r} has no camera")
        return still.render_frame(sync_of(graph), graph, plan, progress=progress, frame_set=moment.frame_set)

    scene = view.find()
    go_to_frame(scene, number, is_simulated or view.for_viewport)
    try:
        return view.read(render)
    except perfect_bvh.Cancelled:
        return None
    except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
        raise CommandError(f"scene {scene.name!r}: {sentence(reason_of(problem))}") from problem


class ImageWriter:
    """Writes frames of a scene in its mode; distances as greys, near white, far black, on the first one's scale."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        from ..settings.modes import mode_of_render

        self._scene = scene
        self._mode = mode_of_render(scene)
        self.range: tuple[float, float] | None = None

    def has_scale(self, suffix: str) -> bool:
        """Whether files of this kind show distances on a scale that is that of the first frame."""
        return self._mode.has_range and suffix.lower() != ".exr"

    def save(self, path: Path, frame: Frame) -> None:
        """The image of a frame. Errors: CommandError."""
        from ..image.saving import save_image

        image = self._grey(frame) if self.has_scale(path.suffix) else frame.images["combined"]
        with explained():
            save_image(path, frame.cut(image), self._scene, self._mode)

    def measure(self, frame: Frame) -> None:
        """Takes the scale of this frame, unless there is one."""
        from perfect_bvh.render import NO_DEPTH

        if self.range is None:
            distances = frame.images["combined"][..., 0]
            hit = distances[(distances > 0.0) & (distances < NO_DEPTH)]  # what lies outside of a border has none
            self.range = (float(hit.min()), float(hit.max())) if hit.size else (0.0, 1.0)

    def _grey(self, frame: Frame) -> npt.NDArray[np.float32]:
        import numpy as np
        from perfect_bvh.render import depth_to_grey

        self.measure(frame)
        image = frame.images["combined"]
        greys = depth_to_grey(image[..., 0], *self.range)
        return np.stack([greys, greys, greys, image[..., 3]], axis=-1)


class RenderWork(PieceWork):
    """Chunks of an animation, with `--resume` or by workers; each begins with new trees."""

    def __init__(self, scene: bpy.types.Scene, stop: StopRequest, arguments: argparse.Namespace) -> None:
        from ..live.scene_view import SceneView
        from ..pieces.piece import Piece, PieceFolder, runs_of, scene_inputs
        from ..settings.preferences import denoiser_in_use

        view = SceneView("render", scene, active_view_layer(scene), for_viewport=arguments.viewport)
        super().__init__(view, arguments.frames or (scene.frame_current,))
        self._stop, self._arguments = stop, arguments
        self._output = Output.parse(arguments.output, len(self.frames))
        self._output.check_frames(self.frames, Path(arguments.file))
        suffix, first = self._output.pattern.suffix, self.frames[0]
        further = {"denoiser": denoiser_in_use(), "format": suffix, "first": first, "begins": self.begins}
        inputs = scene_inputs(arguments, *CHOICES, **further)
        apply_settings(scene, arguments)
        self._writer = ImageWriter(scene)
        self.pieces = [
            Piece(frames, self._stem(frames), tuple(self._output.path_of(frame).name for frame in frames))
            for frames in runs_of(self.frames, arguments.piece, has_gaps=True)
        ]
        before = self._output.pattern.stem.partition("#")[0]
        self.place = PieceFolder(self._output.pattern.parent, inputs, before, "animation")

    def make(self, piece: Piece) -> Steps:
        """Renders with new trees: ids of instances, and the cost of rays, do not depend on earlier chunks."""
        from ..image.still import warnings_of
        from ..live.sync_cache import clear_syncs

        if not self._know_scale(piece):
            return
        clear_syncs()
        warnings = dict[str, None]()
        for number, frame in enumerate(piece.frames):
            rendered = self._render(frame)
            if rendered is None:
                return
            self._writer.save(self._output.path_of(frame), rendered)
            warnings |= dict.fromkeys(warnings_of(rendered))
            yield (number + 1) / len(piece.frames)
        with explained():
            self.place.finish(piece, warnings=list(warnings))
        yield Done({"frames": len(piece.frames)}, tuple(warnings))

    def hold(self, piece: Piece, work: Callable[[], T]) -> T:
        """Runs `work`; each frame is a separate render."""
        return work()

    @property
    def where(self) -> str:
        """The images."""
        return self._output.describe(self.frames)

    def _render(self, frame: int) -> Frame | None:
        if self._stop.is_set:
            return None
        return render_frame(self.view, frame, lambda _: not self._stop.is_set, self.is_simulated)

    def _know_scale(self, piece: Piece) -> bool:
        """Renders the first of all frames, if greys are on its scale and it was not rendered here; False if stopped."""
        first = self.frames[0]
        if self._writer.range is None and self._writer.has_scale(self._output.pattern.suffix) and first != piece.first:
            rendered = self._render(first)
            if rendered is None:
                return False
            self._writer.measure(rendered)
        return True

    def _stem(self, frames: tuple[int, ...]) -> str:
        """Returns the stem of a manifest, which distinguishes it from other JSON files."""
        name = re.sub("#+", f"{frames[0]:04d}-{frames[-1]:04d}", self._output.pattern.stem)
        return f"{name}.manifest"


# Chunk work ----------------------------------------------------------------------------------------------------------
# What `scan`, `labels` and `render` have in common: chunks of a scene's frames, made here or by workers.


Job = Callable[["bpy.types.Scene", StopRequest, argparse.Namespace], PieceWork]


def run_pieces(job: Job, scene: bpy.types.Scene, stop: StopRequest, arguments: argparse.Namespace, out: TextIO) -> int:
    """Does the missing chunks of a command's job, here or by workers, and joins them; returns the exit status."""
    started = time.perf_counter()
    work = job(scene, stop, arguments)
    _prepare_folder(work, arguments)
    if arguments.workers is None and arguments.scheduler is None:
        outcome = _do_here(work, stop, arguments)
    else:
        from .farm.run import do_pieces_on_farm

        outcome = do_pieces_on_farm(work, stop, arguments, out)
    status = _end(work, outcome)
    if not arguments.quiet:
        what, *lines = work.summary(outcome)
        seconds = time.perf_counter() - started
        out.write(f"{work.where}: {outcome.words(len(work.pieces))}; {what} in {seconds:.2f} s\n")
        out.writelines(f"{line}\n" for line in lines)
    return status


def do_piece(work: PieceWork, piece: Piece, stop: StopRequest, advance: Advance = lambda _: None) -> Done | None:
    """Makes the files of a chunk, and its manifest; returns None if it was stopped. advance: called with 0 to 1.

    Raises CommandError for problems that its user can fix; file errors are its cause.
    """

    def go_on(done: float) -> bool:
        advance(done)
        return not stop.is_set

    try:
        done = work.do(piece, go_on)
    except ValueError as error:
        raise CommandError(f"{piece}: {error}") from error
    except OSError as error:
        if is_reader_gone(error):
            raise
        raise CommandError(error.strerror or str(error)) from error
    if done is None and not stop.is_set:
        raise CommandError(f"{piece}: Blender aborted the frame without an error message")
    return done


def _prepare_folder(work: PieceWork, arguments: argparse.Namespace) -> None:
    """Refuses a folder of other work; existing files count as done, or not, by the arguments. Errors: CommandError."""
    from ..pieces.piece import OtherInputsError

    try:
        with explained():
            work.place.prepare(work.pieces, *work.joined, resume=arguments.resume)
    except OtherInputsError as error:
        raise CommandError(f"-o: {error}") from error


def _do_here(work: PieceWork, stop: StopRequest, arguments: argparse.Namespace) -> Outcome:
    """Does all missing chunks, one after the other, in this process. Errors: CommandError."""
    import perfect_bvh

    outcome, teller = Outcome(), Teller()

    def do(piece: Piece, before: int) -> Done | None:
        try:
            return do_piece(work, piece, stop, lambda done: bar.update(before + done - bar.n))
        except (perfect_bvh.EngineError, MemoryError) as error:  # there is no other worker that could try it again
            raise CommandError(f"{piece}: {str(error) or 'there is not enough memory'}") from error

    with progress_bar("chunk", len(work.pieces), arguments.quiet) as bar:
        for done in do_pieces(work, outcome, do):
            teller.tell(outcome.warnings)
            bar.update(done - bar.n)
    return outcome


def _end(work: PieceWork, outcome: Outcome) -> int:
    """Prints what failed, or joins the chunks; returns the exit status."""
    total = len(work.pieces)
    if outcome.failed:
        for piece, reason in outcome.failed:
            sys.stderr.write(f"perfect-bvh: {piece}: {reason}\n")
        sys.stderr.write(f"perfect-bvh: {len(outcome.failed)} of {total} chunks failed; retry them with --resume\n")
        return EXIT_FAILED_PIECES
    if outcome.is_stopped:
        sys.stderr.write(
            f"perfect-bvh: stopped; {outcome.there} of {total} chunks are complete; continue with --resume\n"
        )
        return EXIT_INTERRUPTED
    with explained():
        work.join()
    return 0
