"""Limit how often the growing image of a render is shown. Needs no Blender."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")

SHOW_SECONDS = 0.5


class Throttle(Generic[T]):
    """Calls `show` with the first image, and then at most once every SHOW_SECONDS; drops the images between.

    Blender's main thread converts and draws the whole image for each call, and answers to nothing else until it has.
    """

    def __init__(self, show: Callable[[T], object], clock: Callable[[], float] = time.monotonic) -> None:
        self._show = show
        self._clock = clock
        self._next = float("-inf")

    def __call__(self, image: T) -> None:
        """Show `image`, unless the last one was shown less than SHOW_SECONDS ago, counted from the end of that call."""
        if self._clock() >= self._next:
            self._show(image)
            self._next = self._clock() + SHOW_SECONDS
