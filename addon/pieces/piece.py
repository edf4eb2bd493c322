"""Frames that are worked on together, and the files that come of them. Knows no Blender."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Piece:
    """frames: rising, one at least. stem: of its manifest's name. files: the names of the files it consists of."""

    frames: tuple[int, ...]
    stem: str
    files: tuple[str, ...]

    @property
    def first(self) -> int:
        """The first frame."""
        return self.frames[0]

    @property
    def last(self) -> int:
        """The last frame."""
        return self.frames[-1]

    def __str__(self) -> str:
        if len(self.frames) == 1:
            return f"frame {self.first}"
        return f"frames {self.first}-{self.last}"


def runs_of(frames: Iterable[int], size: int, *, has_gaps: bool = False) -> list[tuple[int, ...]]:
    """The frames, rising, in runs of at most `size`; has_gaps: whether a run may pass over frames."""
    runs: list[list[int]] = []
    for frame in sorted(set(frames)):
        if not runs or len(runs[-1]) == size or (frame != runs[-1][-1] + 1 and not has_gaps):
            runs.append([])
        runs[-1].append(frame)
    return [tuple(run) for run in runs]
