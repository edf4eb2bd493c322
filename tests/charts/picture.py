"""Lines, shapes and words in pixels, y downwards: a chart once its layout is done."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

Point = tuple[float, float]
Anchor = Literal["left", "middle", "right"]
# Of the mean letter, as a share of the font's size; words are placed by this estimate, a little on the safe side.
LETTER_WIDTH = 0.61

HALO = 3.0  # pixels of white about words


@dataclass(frozen=True, slots=True)
class Line:
    """Joined points. dashes: pixels on and off; none: solid."""

    points: Sequence[Point]
    color: str
    width: float
    dashes: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Shape:
    """A filled convex polygon."""

    points: Sequence[Point]
    color: str
    opacity: float = 1.0


@dataclass(frozen=True, slots=True)
class Disc:
    """A filled circle."""

    centre: Point
    radius: float
    color: str


@dataclass(frozen=True, slots=True)
class Text:
    """Words, their anchor at the left end, the middle or the right end of the base line."""

    at: Point
    words: str
    size: float
    color: str = "#222222"
    anchor: Anchor = "left"
    bold: bool = False


@dataclass(slots=True)
class Picture:
    """Draws in this order: shapes, lines and discs are under the words."""

    width: int
    height: int
    marks: list[Line | Shape | Disc] = field(default_factory=list)
    texts: list[Text] = field(default_factory=list)

    def save(self, path: Path, zoom: float = 2.0) -> None:
        """Writes a PNG by matplotlib, `zoom` pixels for each of ours."""
        from . import matplotlib_png

        matplotlib_png.write(self, path, zoom)


def width_of(words: str, size: float, *, bold: bool = False) -> float:
    """The approximate width in pixels."""
    narrow = sum(letter in " .,:;'|!ijlIft()[]" for letter in words)
    wide = sum(letter.isupper() or letter in "mw" for letter in words)
    return (len(words) - 0.45 * narrow + 0.22 * wide) * size * LETTER_WIDTH * (1.08 if bold else 1.0) * 1.04


def wrap(words: str, size: float, room: float) -> list[str]:
    """Lines that fit into `room` pixels."""
    lines: list[str] = []
    for word in words.split():
        if lines and width_of(f"{lines[-1]} {word}", size) <= room:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines
