"""What `scan`, `labels` and `render` have in common: pieces of a scene's frames, done one after the other.

The same in the process of the command line and in those of workers: what a piece holds depends on its frames and inputs
alone, not on what was done before it in its process.
"""

from __future__ import annotations

import argparse
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from .arguments import CommandError
from .blender import StopRequest

if TYPE_CHECKING:
    import bpy

    from ..pieces.folder import PieceFolder
    from ..pieces.piece import Piece

Advance = Callable[[float], object]


@dataclass(frozen=True, slots=True)
class Done:
    """What is told of a piece that was done. counts: numbers, by their names, which are added up for the summary."""

    counts: dict[str, int] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


@dataclass(slots=True)
class Outcome:
    """What came of a run. failed: pieces and the reasons, a sentence each."""

    written: int = 0
    kept: int = 0
    counts: dict[str, int] = field(default_factory=dict)
    failed: list[tuple[Piece, str]] = field(default_factory=list)
    is_stopped: bool = False

    def add(self, done: Done) -> None:
        """Counts a piece more."""
        self.written += 1
        for name, count in done.counts.items():
            self.counts[name] = self.counts.get(name, 0) + count


class PieceWork(ABC):
    """The pieces of a command. Made once a scene is open; `pieces` and `place` are there then."""

    pieces: list[Piece]
    place: PieceFolder
    joined: tuple[str, ...] = ()  # names of files that are made of all pieces in the end

    def __init__(self, scene: bpy.types.Scene, stop: StopRequest, arguments: argparse.Namespace) -> None:
        from ..extract.simulations import has_simulations

        self.scene = scene
        self.stop = stop
        self.arguments = arguments
        self.frames: tuple[int, ...] = arguments.frames or (scene.frame_current,)
        self.is_simulated = has_simulations(scene)
        self._played_to = min(self.frames) - 1

    def can_do(self, piece: Piece) -> bool:
        """Whether the scene can come to this piece as it is now; what is simulated does not run backwards."""
        return not self.is_simulated or piece.first > self._played_to

    def do(self, piece: Piece, advance: Advance) -> Done | None:
        """Makes the files of a piece, and its manifest; None if it was stopped. advance: called with 0 to 1.

        Raises CommandError.
        """
        self._play_to(piece.first)
        done = None if self.stop.is_set else self.make(piece, advance)
        if done is not None:
            self._played_to = piece.last
        elif not self.stop.is_set:
            raise CommandError(f"{piece}: Blender has given it up, and says no more")
        return done

    @abstractmethod
    def make(self, piece: Piece, advance: Advance) -> Done | None:
        """The files and the manifest of a piece to whose first frame the scene was played; as `do`."""

    @abstractmethod
    def join(self) -> None:
        """Makes the files for which all pieces have to be there, if there are such. Raises CommandError."""

    def _play_to(self, frame: int) -> None:
        """Through the frames before, if anything is simulated: it depends on them."""
        if self.is_simulated:
            for number in sorted(set(self.frames)):
                if self._played_to < number < frame and not self.stop.is_set:
                    self.scene.frame_set(number)


def scene_inputs(path: Path, arguments: argparse.Namespace, **options: Any) -> dict[str, Any]:
    """Of a scene that is open, with all the files that it reads; options: of the command."""
    from ..pieces.scene_inputs import scene_inputs as inputs_of_scene

    return inputs_of_scene(path, autoexec=arguments.autoexec, allow_missing=arguments.allow_missing, **options)


def prepare_folder_of(work: PieceWork) -> None:
    """Refuses a folder of other work; what is there counts as done, or not, as is asked. Errors: CommandError."""
    from ..pieces.folder import OtherInputsError

    try:
        with explained():
            work.place.prepare(work.pieces, *work.joined, resume=work.arguments.resume)
    except OtherInputsError as error:
        raise CommandError(f"-o: {error}") from error


def do_pieces(work: PieceWork) -> Outcome:
    """All pieces that are not there, one after the other, in this process. Errors: CommandError."""
    outcome, teller = Outcome(), Teller()
    with piece_bar(work) as bar:
        for number, piece in enumerate(work.pieces):

            def advance(done: float, before: int = number) -> bool:
                bar.update(before + done - bar.n)
                return not work.stop.is_set

            if work.place.is_done(piece):
                outcome.kept += 1
            else:
                done = None if work.stop.is_set else _do(work, piece, advance)
                if done is None:
                    outcome.is_stopped = True
                    break
                outcome.add(done)
                teller.tell(done)
            bar.update(number + 1 - bar.n)
    return outcome


def _do(work: PieceWork, piece: Piece, advance: Advance) -> Done | None:
    """As `PieceWork.do`, where there is no other worker that could try it again."""
    import perfect_bvh

    try:
        return work.do(piece, advance)
    except (perfect_bvh.EngineError, MemoryError) as error:
        raise CommandError(f"{piece}: {str(error) or 'there is not enough memory'}") from error


def piece_bar(work: PieceWork) -> Any:
    """A progress bar over pieces; on a terminal only, so that logs stay clean."""
    from tqdm import tqdm

    bar_format = "{l_bar}{bar}| {n:.3g}/{total} [{elapsed}<{remaining}]"
    is_disabled = True if work.arguments.quiet else None
    return tqdm(
        total=len(work.pieces), unit="piece", bar_format=bar_format, disable=is_disabled, leave=False, file=sys.stderr
    )


class Teller:
    """Writes warnings, each once."""

    def __init__(self, told: set[str] | None = None) -> None:
        self._told = told if told is not None else set()

    def tell(self, done: Done) -> None:
        """Those of a piece."""
        for warning in done.warnings:
            if warning not in self._told:
                self._told.add(warning)
                self.say(warning)

    def say(self, sentence: str) -> None:
        """Beside a progress bar."""
        from tqdm import tqdm

        tqdm.write(f"perfect-bvh: {sentence}", file=sys.stderr)


@contextmanager
def explained() -> Iterator[None]:
    """Errors of files become CommandErrors, which keep them as their cause."""
    try:
        yield
    except OSError as error:
        raise CommandError(error.strerror or str(error)) from error


def run_pieces(work: PieceWork, out: TextIO) -> tuple[Outcome, int]:
    """Does what is missing, here or by workers, and joins it; what came of it, and the exit status."""
    from . import EXIT_FAILED_PIECES, EXIT_INTERRUPTED

    prepare_folder_of(work)
    arguments = work.arguments
    if arguments.workers is None and arguments.scheduler is None:
        outcome = do_pieces(work)
    else:
        from .farm.run import do_pieces_on_farm

        outcome = do_pieces_on_farm(work, out)
    if outcome.failed:
        for piece, reason in outcome.failed:
            sys.stderr.write(f"perfect-bvh: {piece}: {reason}\n")
        count = f"{len(outcome.failed)} of {len(work.pieces)} pieces failed"
        sys.stderr.write(f"perfect-bvh: {count}; --resume tries them again\n")
        return outcome, EXIT_FAILED_PIECES
    if outcome.is_stopped:
        done = outcome.written + outcome.kept
        sys.stderr.write(f"perfect-bvh: stopped; {done} of {len(work.pieces)} pieces are there; --resume goes on\n")
        return outcome, EXIT_INTERRUPTED
    work.join()
    return outcome, 0
