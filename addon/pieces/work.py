"""Work over frames, chunk by chunk: one driver for the command line, its workers and the Scan button.

The content of a chunk depends only on its frames and inputs, not on earlier work of its process. So all
callers get the same bytes: at once (`PieceWork.do`), or in steps between which Blender's user continues
(`PieceWork.steps`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

from ..statistics.words import count_of

if TYPE_CHECKING:
    from ..live.scene_view import SceneView
    from .piece import Piece, PieceFolder

T = TypeVar("T")
Advance = Callable[[float], object]


@dataclass(frozen=True, slots=True)
class Done:
    """The report of a finished chunk. counts: numbers, by their names, which are added up for the summary."""

    counts: dict[str, int] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


Steps = Generator[float | Done, None, None]  # the share done, 0 to 1; then, unless it was stopped, the report


@dataclass(slots=True)
class Outcome:
    """The outcome of a run. warnings: of the finished chunks, each once. failed: chunks and the reasons."""

    written: int = 0
    kept: int = 0
    counts: dict[str, int] = field(default_factory=dict)
    warnings: dict[str, None] = field(default_factory=dict)
    failed: list[tuple[Piece, str]] = field(default_factory=list)
    is_stopped: bool = False

    @property
    def there(self) -> int:
        """Returns the number of complete chunks."""
        return self.written + self.kept

    def add(self, done: Done) -> None:
        """Counts one more chunk."""
        self.written += 1
        self.warnings |= dict.fromkeys(done.warnings)
        for name, count in done.counts.items():
            self.counts[name] = self.counts.get(name, 0) + count

    def words(self, total: int, what: str = "chunks") -> str:
        """Returns how many of `total` were done, and how many existed before."""
        recognised = f", {self.kept} existed" if self.kept else ""
        return f"{self.written} of {total} {what}{recognised}"


class PieceWork(ABC):
    """Some frames of a scene, in chunks; the constructor sets `pieces` and `place`.

    view: the scene, and how it is read. frames: in any order.
    """

    pieces: list[Piece]
    place: PieceFolder
    joined: tuple[str, ...] = ()  # names of files that are made of all chunks in the end

    def __init__(self, view: SceneView, frames: tuple[int, ...]) -> None:
        from ..extract.scene_in_time import has_simulations

        self.view = view
        self.frames = frames
        self.is_simulated = has_simulations(view.find())
        self.begins = min(frames) if self.is_simulated else None  # simulations depend on their first frame
        self._played_to = min(frames) - 1

    def can_do(self, piece: Piece) -> bool:
        """Whether the scene in its current state can go to this chunk; simulations do not run backwards."""
        return not self.is_simulated or piece.first > self._played_to

    def do(self, piece: Piece, advance: Advance) -> Done | None:
        """Makes the files of a chunk, and its manifest, at once; None if it was stopped.

        advance: called with 0 to 1; False stops.
        """
        if advance(0.0) is False or any(advance(share) is False for share in self._play_to(piece.first)):
            return None
        done = self.hold(piece, lambda: _last(self.make(piece), advance))
        if done is not None:
            self._played_to = piece.last
        return done

    def steps(self, piece: Piece) -> Steps:
        """Does the same in steps. Closing it drops the chunk."""
        yield from self._play_to(piece.first)
        yield from self.make(piece)
        self._played_to = piece.last

    @abstractmethod
    def make(self, piece: Piece) -> Steps:
        """Makes the files and the manifest of a chunk, to whose first frame the scene was played."""

    def hold(self, piece: Piece, work: Callable[[], T]) -> T:
        """Returns what `work` does, for which the scene is evaluated once and then goes from frame to frame."""
        from ..live.scene_view import go_to_frame

        go_to_frame(self.view.find(), piece.first, self.is_simulated or self.view.for_viewport)
        return self.view.hold(work)

    def join(self) -> None:  # noqa: B027 - most make none
        """Makes the files that need all chunks, if any."""

    @property
    def where(self) -> str:
        """Describes the place of its files, in words."""
        return str(self.place.folder)

    def summary(self, outcome: Outcome) -> tuple[str, ...]:
        """How much was made, in few words, and further lines."""
        return (count_of(outcome.counts.get("frames", 0), "frame"),)

    def _play_to(self, frame: int) -> Generator[float, None, None]:
        """Goes through the frames before, if anything is simulated: it depends on them."""
        if self.is_simulated:
            for number in sorted(set(self.frames)):
                if self._played_to < number < frame:
                    self.view.find().frame_set(number)
                    yield 0.0


def do_pieces(
    work: PieceWork, outcome: Outcome, do: Callable[[Piece, int], Done | None] | None = None
) -> Generator[float, None, None]:
    """Does all missing chunks; yields the number of finished ones, with fractions. Closing it keeps whole chunks.

    outcome: the results so far. do: makes a chunk at once, given the number of chunks before it; None: in steps.
    """
    for before, piece in enumerate(work.pieces):
        yield before
        if work.place.is_done(piece):
            outcome.kept += 1
            continue
        done = None if do is None else do(piece, before)
        if do is None:
            with closing(work.steps(piece)) as steps:
                for step in steps:
                    if isinstance(step, Done):
                        done = step
                    else:
                        yield before + min(step, 0.999)
        if done is None:
            outcome.is_stopped = True
            return
        outcome.add(done)
    yield len(work.pieces)


def _last(steps: Steps, advance: Advance) -> Done | None:
    """Returns the result of steps, unless `advance` stops them."""
    with closing(steps):
        for step in steps:
            if isinstance(step, Done):
                return step
            if advance(step) is False:
                break
    return None
