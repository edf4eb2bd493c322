"""Work that stays where a step wants it, however fast the machine is: it goes as far as its gate is open, no further.

What has to be under way still when something is done to it is held, and not only made so large that it should last.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager
from typing import Any

from addon_state import is_working, module
from driver import Step, check, wait_until

HELD_SECONDS = 0.02


class ScanGate:
    """Scans go on to a share of the whole, 0 to 1, and stay there, as if a frame took long, until it is raised."""

    def __init__(self) -> None:
        self._share = math.inf
        self._is_holding = False

    def set_to(self, share: float) -> None:
        self._share, self._is_holding = share, False

    def open(self) -> None:
        self.set_to(math.inf)

    def wait(self, what: str) -> Step:
        """Until a scan is held. what: is said if none comes so far."""
        yield from wait_until(lambda: self._is_holding, what, 60)
        check(is_working(), f"{what}: it is over")

    def steps(self, original: Callable[[Any], Iterator[float]], scanner: Any) -> Generator[float, None, None]:
        with closing(original(scanner)) as inner:
            for done in inner:
                yield done
                while done >= self._share:
                    self._is_holding = True
                    time.sleep(HELD_SECONDS)
                    yield done
        self._is_holding = False


@contextmanager
def scan_gate() -> Iterator[ScanGate]:
    """Open as long as nobody sets it."""
    gate, scanner = ScanGate(), module("scanning.scan").Scanner
    original, scanner.steps = scanner.steps, lambda scanner: gate.steps(original, scanner)
    try:
        yield gate
    finally:
        scanner.steps = original
