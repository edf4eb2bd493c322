"""Presses Ctrl-C in a console of Windows', which Wine makes of a terminal of this system."""

from __future__ import annotations

import os
import pty
import select
import signal
import time
from collections.abc import Sequence
from pathlib import Path

from system import REPOSITORY, WineSystem

START_SECONDS, PATIENCE_SECONDS = 120.0, 20.0
SCRIPT = Path(__file__).with_name("interrupted.py")
WAYS = ("waiting", "request", "work", "engine")
CTRL_C = b"\x03"


def check_interrupts(system: WineSystem, packages: Sequence[Path], folder: Path) -> None:
    """Each way of waiting that interrupted.py has ends. Raises SystemExit if one does not."""
    for way in WAYS:
        told = folder / f"ctrl_c_{way}.txt"
        told.unlink(missing_ok=True)
        answer = _press(system, packages, told, way)
        print(f"{way:12}{answer}", flush=True)
        if answer != "interrupted":
            raise SystemExit(f"Ctrl-C did not end {way!r}, which was: {answer or 'not ready'}")


def _press(system: WineSystem, packages: Sequence[Path], told: Path, way: str) -> str:
    """The program's last words in the file `told`."""
    command, environment = system.call((SCRIPT, told, way), packages)
    program, terminal = pty.fork()
    if program == 0:
        os.chdir(REPOSITORY)
        os.execve(command[0], command, environment)
    try:
        _read_until(terminal, told, ("ready",), START_SECONDS)
        _read_until(terminal, told, (), 0.5)  # so that it waits by then, which cannot be observed
        os.write(terminal, CTRL_C)
        _read_until(terminal, told, ("interrupted", "nothing"), PATIENCE_SECONDS)
        return told.read_text() if told.exists() else ""
    finally:
        os.kill(program, signal.SIGKILL)
        os.waitpid(program, 0)
        os.close(terminal)


def _read_until(terminal: int, told: Path, words: Sequence[str], seconds: float) -> None:
    """Reads the console, so that it does not block, until the program writes one of the words or time is over."""
    end = time.monotonic() + seconds
    while time.monotonic() < end and not (told.exists() and told.read_text() in words):
        if select.select([terminal], [], [], 0.1)[0]:
            try:
                os.read(terminal, 1 << 16)
            except OSError:  # the program has ended
                return
