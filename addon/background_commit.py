"""A commit of an engine's scene on a thread of its own, so that whoever began it answers its user meanwhile.

A commit touches nothing but the engine's scene and lets go of Python's lock: what reads Blender comes before it, what
uses the trees after it, both on the thread of whoever began it. Knows no Blender.
"""

from __future__ import annotations

import atexit
import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar

Committed = TypeVar("Committed")
Report = TypeVar("Report")

# Those whose thread lives, kept from being forgotten: a process that ends waits for each.
_running: set[BackgroundCommit[Any, Any]] = set()


class BackgroundCommit(Generic[Committed, Report]):
    """Begins at once.

    commit: called on the new thread with a progress callable, as the engine's `commit` wants it.
    finish: called at most once, with what `commit` returned, by the first `settle`, `stop` or `result`, on the thread
        that calls that: whatever is to know of the new trees learns it there and not before.
    """

    def __init__(
        self, commit: Callable[[Callable[[float], bool]], Committed], finish: Callable[[Committed], Report]
    ) -> None:
        self._commit, self._finish = commit, finish
        self._share = 0.0
        self._shall_stop = False
        self._has_ended = threading.Event()
        self._committed: list[Committed] = []
        self._reports: list[Report] = []
        self._problem: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="Perfect BVH commit", daemon=True)
        _running.add(self)
        try:
            self._thread.start()
        except RuntimeError:  # the system has no thread to spare: better late than never
            self._run()

    def _run(self) -> None:
        try:
            self._committed.append(self._commit(self._advance))
        except BaseException as problem:  # noqa: BLE001 - handed on by `result`
            self._problem = problem
        finally:
            self._has_ended.set()
            _running.discard(self)

    def _advance(self, share: float) -> bool:
        self._share = share
        return not self._shall_stop

    @property
    def share(self) -> float:
        """The share done, 0 to 1."""
        return self._share

    @property
    def is_running(self) -> bool:
        """Whether the thread is at work."""
        return not self._has_ended.is_set()

    def wait(self, seconds: float) -> bool:
        """Waits for the end, at most so long; whether it has come. Ctrl-C ends the waiting, not the commit."""
        return self._has_ended.wait(seconds)

    def ask_to_stop(self) -> None:
        """From any thread; the commit looks about every twentieth of a second. One that is too far gets done."""
        self._shall_stop = True

    def stop(self) -> None:
        """Asks the commit to stop, and waits until it has."""
        self.ask_to_stop()
        self.settle()

    def settle(self) -> None:
        """Waits for the end, whatever it is; `finish` has been called if the commit succeeded."""
        self._has_ended.wait()
        while self._committed:
            self._reports.append(self._finish(self._committed.pop()))

    def result(self) -> Report:
        """Waits for the end; returns what `finish` did. Raises what the commit did, `Cancelled` if it was stopped.

        Ctrl-C stops it.
        """
        try:
            self.settle()
        except KeyboardInterrupt:
            self.stop()
            raise
        if self._problem is not None:
            raise self._problem
        return self._reports[0]


@atexit.register
def _stop_all() -> None:
    """A thread that is still at work in the engine when Python goes would take the process down with it."""
    for commit in tuple(_running):
        commit.ask_to_stop()
    for commit in tuple(_running):
        commit._thread.join()
