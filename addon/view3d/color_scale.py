"""What colours mean, for a legend: numbers along a bar or beside swatches. Knows no Blender."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Scale:
    """What colours mean. caption: what they tell. labels: places from 0 to 1, and the numbers there.

    levels: how many swatches stand in the place of a bar, one a level; 0 for a bar.
    """

    caption: str
    labels: tuple[tuple[float, str], ...]
    levels: int = 0
