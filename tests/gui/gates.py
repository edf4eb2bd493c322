"""Gates hold work at the point that a step needs, independent of the machine's speed.

A step that needs unfinished work holds it at a gate instead of making it large and hoping that it lasts.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager
from typing import Any

from addon_state import module
from driver import Step, wait_until

Condition = Callable[[Any, Any], object]

HELD_SECONDS = 0.02
LONGEST = 300.0  # then work is released, and the step fails: a Blender that waits for held work could not go on


class Gate:
    """Open at first. Work calls it repeatedly with its progress, and waits there while it is held."""

    def __init__(self) -> None:
        self._shall_hold: Condition | None = None
        self._holds_for: Condition | None = None
        self._deadline = 0.0

    def hold_when(self, condition: Condition) -> None:
        """Hold work for which `condition` is true; it is called with the work and its progress."""
        self._deadline = time.monotonic() + LONGEST
        self._shall_hold = condition

    def open(self) -> None:
        self._shall_hold = None

    @property
    def is_holding(self) -> bool:
        """Whether some work is held by the latest condition."""
        return self._holds_for is not None and self._holds_for is self._shall_hold

    def wait(self, what: str) -> Step:
        """Wait until work is held."""
        yield from wait_until(lambda: self.is_holding, f"{what} is not under way, or over before it could be held")

    def keeps(self, work: Any, far: Any) -> bool:
        """Called repeatedly by work on any thread, as long as it returns true."""
        condition = self._shall_hold
        is_kept = condition is not None and bool(condition(work, far)) and time.monotonic() < self._deadline
        self._holds_for = condition if is_kept else None
        return is_kept

    def leave(self) -> None:
        """Work that is over or given up is not held any more."""
        self._holds_for = None


@contextmanager
def _placed(gate: Gate, owner: Any, name: str, make: Callable[[Any], Any]) -> Iterator[Gate]:
    """Before a method."""
    original = getattr(owner, name)
    setattr(owner, name, make(original))
    try:
        yield gate
    finally:
        gate.open()
        setattr(owner, name, original)


@contextmanager
def gate_of_steps(owner: type) -> Iterator[Gate]:
    """For a class whose `steps()` do its work in parts while Blender goes on. Progress: the value of a step."""
    gate = Gate()

    def make(original: Callable[[Any], Generator[Any, None, None]]) -> Any:
        def steps(worker: Any) -> Generator[Any, None, None]:
            try:
                with closing(original(worker)) as inner:
                    for done in inner:
                        yield done
                        while gate.keeps(worker, done):
                            time.sleep(HELD_SECONDS)  # like a frame that takes long
                            yield done
            finally:
                gate.leave()

        return steps

    with _placed(gate, owner, "steps", make):
        yield gate


@contextmanager
def gate_of_builds() -> Iterator[Gate]:
    """For trees that are built while Blender goes on; a cancelled build is released. The progress is the share done."""
    gate = Gate()

    def make(original: Callable[[Any, float], bool]) -> Any:
        def advance(work: Any, share: float) -> bool:
            while not work._shall_stop and gate.keeps(work, share):
                time.sleep(HELD_SECONDS)
            gate.leave()
            return original(work, share)

        return advance

    with _placed(gate, module("support.background_work").BackgroundWork, "_advance", make):
        yield gate


@contextmanager
def gate_of_renders() -> Iterator[Gate]:
    """For renders in the background; one that Blender cancels is released. The progress is the share done."""
    gate = Gate()

    def make(original: Callable[[Any, Any, float], bool]) -> Any:
        def advance(engine: Any, job: Any, share: float) -> bool:
            while not engine.test_break() and gate.keeps(engine, share):
                time.sleep(HELD_SECONDS)
            gate.leave()
            return original(engine, job, share)

        return advance

    with _placed(gate, module("engine").PerfectBVHRenderEngine, "_advance", make):
        yield gate


def always(_: Any, __: Any) -> bool:
    """A condition that holds work as soon as it comes."""
    return True
