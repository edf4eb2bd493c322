"""Work in a forked process."""

from __future__ import annotations

import os
import signal
import warnings
from collections.abc import Callable

import pytest

SECONDS = 120  # rather than to hang
needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")


def run_in_child(work: Callable[[], bool]) -> int:
    """0 if the work came true in a forked process, 1 if not, 2 if it raised, below 0 if a signal ended it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # newer Pythons warn of threads, which are the point
        child = os.fork()
    if child == 0:
        code = 2
        try:
            signal.alarm(SECONDS)
            code = 0 if work() else 1
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
