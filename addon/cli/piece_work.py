"""What `scan`, `labels` and `render` have in common: pieces of a scene's frames, done here or by workers."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, TextIO

from ..pieces.work import Advance, Done, Outcome, PieceWork, do_pieces
from .arguments import EXIT_FAILED_PIECES, EXIT_INTERRUPTED, CommandError, explained
from .blender import StopRequest
from .console import Teller, is_reader_gone, progress_bar

if TYPE_CHECKING:
    import bpy

    from ..pieces.piece import Piece

Job = Callable[["bpy.types.Scene", StopRequest, argparse.Namespace], PieceWork]


def run_pieces(job: Job, scene: bpy.types.Scene, stop: StopRequest, arguments: argparse.Namespace, out: TextIO) -> int:
    """Does what is missing of a command's job, here or by workers, joins it and tells of it; the exit status."""
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
    """Makes the files of a piece, and its manifest; None if it was stopped. advance: called with 0 to 1.

    Raises CommandError for what its user can mend; what is of files has that as its cause.
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
        raise CommandError(f"{piece}: Blender has given it up, and says no more")
    return done


def _prepare_folder(work: PieceWork, arguments: argparse.Namespace) -> None:
    """Refuses a folder of other work; what is there counts as done, or not, as is asked. Errors: CommandError."""
    from ..pieces.folder import OtherInputsError

    try:
        with explained():
            work.place.prepare(work.pieces, *work.joined, resume=arguments.resume)
    except OtherInputsError as error:
        raise CommandError(f"-o: {error}") from error


def _do_here(work: PieceWork, stop: StopRequest, arguments: argparse.Namespace) -> Outcome:
    """All pieces that are not there, one after the other, in this process. Errors: CommandError."""
    import perfect_bvh

    outcome, teller = Outcome(), Teller()

    def do(piece: Piece, before: int) -> Done | None:
        try:
            return do_piece(work, piece, stop, lambda done: bar.update(before + done - bar.n))
        except (perfect_bvh.EngineError, MemoryError) as error:  # there is no other worker that could try it again
            raise CommandError(f"{piece}: {str(error) or 'there is not enough memory'}") from error

    with progress_bar("piece", len(work.pieces), arguments.quiet) as bar:
        for done in do_pieces(work, outcome, do):
            teller.tell(outcome.warnings)
            bar.update(done - bar.n)
    return outcome


def _end(work: PieceWork, outcome: Outcome) -> int:
    """Says what failed, and joins the pieces if they are there; the exit status."""
    total = len(work.pieces)
    if outcome.failed:
        for piece, reason in outcome.failed:
            sys.stderr.write(f"perfect-bvh: {piece}: {reason}\n")
        sys.stderr.write(f"perfect-bvh: {len(outcome.failed)} of {total} pieces failed; --resume tries them again\n")
        return EXIT_FAILED_PIECES
    if outcome.is_stopped:
        sys.stderr.write(f"perfect-bvh: stopped; {outcome.there} of {total} pieces are there; --resume goes on\n")
        return EXIT_INTERRUPTED
    work.join()
    return 0
