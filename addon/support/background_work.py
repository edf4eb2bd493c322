"""A long call of the engine on a separate thread, so that the thread that began it stays responsive.

A commit uses only the engine's scene and releases Python's lock. Code that reads Blender runs before it, code that
uses the trees after it, both on the thread that began it. The same holds for large batches of rays. Does not depend on
Blender.
"""

from __future__ import annotations

import atexit
import os
import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar

Made = TypeVar("Made")
Report = TypeVar("Report")

THREAD_NAME = "Perfect BVH work"
# The interval at which a waiting caller checks for Ctrl-C: on Windows it does not interrupt a wait.
_HEARING_SECONDS = 0.05

# Those whose thread lives, kept from being forgotten: a process that ends waits for each.
_running: set[BackgroundWork[Any, Any]] = set()


class BackgroundWork(Generic[Made, Report]):
    """Begins at once.

    work: called on the new thread with a progress callable, as the engine's long calls want it.
    finish: called at most once, with the return value of `work`, by the first `settle`, `stop` or `result`, on the
        thread that calls that: it publishes the result there and not before.
    when_stopped: called in addition when the work is asked to stop, on the thread that asks.

    A forked process has no such thread: there it has failed, unless it had finished.
    """

    def __init__(
        self,
        work: Callable[[Callable[[float], bool]], Made],
        finish: Callable[[Made], Report],
        when_stopped: Callable[[], object] | None = None,
    ) -> None:
        self._work, self._finish, self._when_stopped = work, finish, when_stopped
        self._share = 0.0
        self._shall_stop = False
        self._has_ended = threading.Event()
        self._made: list[Made] = []
        self._reports: list[Report] = []
        self._problem: BaseException | None = None
        self.is_lost = False
        """Whether it was running when this process was forked: its data may be locked for ever."""
        self._thread = threading.Thread(target=self._run, name=THREAD_NAME, daemon=True)
        _running.add(self)
        try:
            self._thread.start()
        except RuntimeError:  # the system has no thread to spare: better late than never
            self._run()
        except BaseException:  # Ctrl-C: the result will not be asked for
            self.ask_to_stop()
            raise

    def _run(self) -> None:
        try:
            self._made.append(self._work(self._advance))
        except BaseException as problem:  # noqa: BLE001 - handed on by `result`
            self._problem = problem
        finally:
            self._work = _over  # releases its objects
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

    @property
    def is_wanted(self) -> bool:
        """Whether it was not asked to stop."""
        return not self._shall_stop

    def wait(self, seconds: float) -> bool:
        """Waits for the end, at most `seconds`; returns whether it has ended. Ctrl-C ends the waiting, not the work."""
        return self._has_ended.wait(seconds)

    def ask_to_stop(self) -> None:
        """Requests a stop, from any thread; the engine checks for it about every twentieth of a second."""
        self._shall_stop = True
        if self._when_stopped is not None:
            self._when_stopped()

    def stop(self) -> None:
        """Asks for the end, and waits for it."""
        self.ask_to_stop()
        self.settle()

    def settle(self) -> None:
        """Waits for the end, successful or not; `finish` has been called if the work succeeded.

        An error of `finish` is the work's failure: `result` raises it, and this method only if it is no `Exception`.
        """
        while not self._has_ended.wait(_HEARING_SECONDS):
            pass
        while self._made:
            try:
                self._reports.append(self._finish(self._made.pop()))
            except Exception as problem:  # noqa: BLE001 - handed on by `result`
                self._problem = problem
            except BaseException as problem:
                self._problem = problem
                raise

    def result(self) -> Report:
        """Waits for the end; returns the result of `finish`. Raises the work's error, `Cancelled` if it was stopped.

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


def _over(_: Callable[[float], bool]) -> Any:
    """Replaces the work of an ended call."""


def _lose_all() -> None:
    """Marks all work as lost, in a forked process."""
    from perfect_bvh import EngineError

    for work in tuple(_running):
        work._has_ended = threading.Event()  # the thread may have held its lock
        work._has_ended.set()
        if not work._made and work._problem is None:
            work.is_lost = True
            work._problem = EngineError("the process was forked during the work: only its parent process continues")
    _running.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_lose_all)


@atexit.register
def _stop_all() -> None:
    """A thread that is still at work in the engine when Python goes would take the process down with it."""
    for work in tuple(_running):
        work.ask_to_stop()
    for work in tuple(_running):
        work._thread.join()
