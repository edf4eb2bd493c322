"""Shared helpers for tests of long builds: commits that last as long as a test wants, and operators without windows."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import bpy
import perfect_bvh
import pytest
from perfect_bvh_addon.support import background_work

HALF = 0.5
# Timeout in seconds after which a test reports that something hangs; even on a slow machine nothing takes as long.
PATIENCE = 120.0
TIMER, ESCAPE, MOUSE = (SimpleNamespace(type=kind) for kind in ("TIMER", "ESC", "MOUSEMOVE"))


class Gate:
    """Holds each commit that can be cancelled until the gate is opened. held: the number of held commits.

    Commits are held at half of their progress, before anything is built. With `inside` they are held where the engine
    first asks whether to go on, which it does after a twentieth of a second.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *, inside: bool = False) -> None:
        self._is_open = threading.Event()
        self.held = 0
        commit = perfect_bvh.Scene.commit

        def goes_on(progress: Any, share: float) -> bool:
            """Return whether to go on, once the gate is open or the waiting thread has given up."""
            if self._is_open.is_set():
                return progress(share) is not False
            answer = progress(share)
            self.held += 1
            while answer is not False and not self._is_open.wait(0.002):
                answer = progress(share)
            return answer is not False

        def hold(scene: perfect_bvh.Scene, expected_rays: int | None = None, *, progress: Any = None) -> Any:
            if progress is not None and inside:
                return commit(scene, expected_rays, progress=partial(goes_on, progress))
            if progress is not None and not self._is_open.is_set() and not goes_on(progress, HALF):
                raise perfect_bvh.Cancelled("the commit was cancelled")
            return commit(scene, expected_rays, progress=progress)

        monkeypatch.setattr(perfect_bvh.Scene, "commit", hold)

    def wait_until_held(self, count: int = 1) -> None:
        """Wait until `count` commits have reported their progress and are held."""
        wait_until(lambda: self.held >= count, "no commit was held")

    def open(self) -> None:
        self._is_open.set()

    def close(self) -> None:
        self._is_open.clear()


def patiently(complaint: str) -> Iterator[None]:
    """Iterate until the caller's loop ends by itself. If something hangs, the test fails with a complaint."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        yield
    pytest.fail(f"{complaint} after {PATIENCE:.0f} s")


def wait_until(condition: Callable[[], object], complaint: str = "it hangs") -> None:
    """Poll until the condition holds; fail as `patiently` does."""
    for _ in patiently(complaint):
        if condition():
            return
        time.sleep(0.002)


def building_threads() -> int:
    """Return the number of commits that are running."""
    return sum(work.is_running for work in tuple(background_work._running))


class FakeOperator:
    """Stands in for Blender's part of an operator; `reports` holds the messages that the user would read."""

    def __init__(self, operator: type) -> None:
        self._operator = operator
        self.reports: list[tuple[str, str]] = []

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._operator, name)
        return partial(found, self) if callable(found) else found

    def report(self, kinds: set[str], text: str) -> None:
        self.reports.append((*kinds, text))


class FakeWindow:
    """A context with a window. status: the text of its status bar. timers: the number of running timers."""

    def __init__(self) -> None:
        self.status: str | None = None
        self.timers = 0
        self.handlers: list[Any] = []
        self.progress: list[float] = []
        manager = SimpleNamespace(
            event_timer_add=self._add_timer,
            event_timer_remove=self._remove_timer,
            progress_begin=lambda low, high: None,
            progress_update=self.progress.append,
            progress_end=lambda: None,
            modal_handler_add=self.handlers.append,
            windows=(),
        )
        self._known = {"window_manager": manager, "workspace": SimpleNamespace(status_text_set=self._show)}

    def _show(self, draw: Callable[[Any, Any], None] | None) -> None:
        told: list[str] = []
        layout = MagicMock(label=lambda text: told.append(text))
        if draw is not None:
            draw(SimpleNamespace(layout=layout), self)
        self.status = told[0] if told else None

    def _add_timer(self, seconds: float, window: Any) -> str:
        self.timers += 1
        return "timer"

    def _remove_timer(self, timer: str) -> None:
        assert timer == "timer"
        self.timers -= 1

    def __getattr__(self, name: str) -> Any:
        return self._known[name] if name in self._known else getattr(bpy.context, name)


def tick_until_half(operator: FakeOperator, window: FakeWindow) -> None:
    """Let a button's timer tick until the reported progress says that half of the trees are built."""
    for _ in patiently("half of the trees are not built"):
        assert operator.modal(window, TIMER) == {"RUNNING_MODAL"}
        if "Building BVHs 50%" in (window.status or ""):
            return
